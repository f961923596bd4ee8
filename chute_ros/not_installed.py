"""What to do where a package cannot be imported."""

from __future__ import annotations

from chute_ros.errors import ChuteError

#: What no vehicle needs for its flight (requirements/extra.in).
_EXTRA = ("nicegui",)
_NOT_BUILT = (
    "chute_msgs cannot be imported: build both packages and source the result:\n"
    "  colcon build --base-paths src src/chute_ros/msg_defs   (in your workspace)\n"
    "  colcon build                                           (in the repository's root)\n"
    "  source install/setup.bash"
)


def remedy(error: ImportError) -> str:
    """What is missing, and how to get it; empty: no package is, something in it is."""
    missing = error.name or ""
    if missing.startswith("chute_msgs") or isinstance(error, ChuteError):
        return f"{_NOT_BUILT}\n({error})"
    if missing.partition(".")[0] in _EXTRA:
        return f"{missing} is not installed: `pip install -r requirements/extra.in` brings it"
    # A module of ours that lacks a name is a mistake of ours.
    if isinstance(error, ModuleNotFoundError) and missing and not missing.startswith("chute_ros"):
        return (
            f"{missing} is not installed: `rosdep install --from-paths src "
            "src/chute_ros/msg_defs --ignore-src` and "
            "`pip install -r requirements/runtime.in` bring all that is needed"
        )
    return ""
