"""Executable deploy_action: the service safety/deploy as an action, with feedback."""

from chute_ros.ros.entry import run


def main() -> None:
    """Run the node."""
    run("deploy_action", "chute_ros.ros.deploy_action_node:DeployActionNode", actions=True)


if __name__ == "__main__":
    main()
