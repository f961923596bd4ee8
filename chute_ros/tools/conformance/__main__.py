"""python3 -m chute_ros.tools.conformance"""

from chute_ros.tools.conformance import main

if __name__ == "__main__":
    main()
