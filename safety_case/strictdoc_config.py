"""How StrictDoc reads the safety case."""

from strictdoc.core.project_config import ProjectConfig

#: Folders of the files that requirements name.
FOLDERS = (
    "bench",
    "chute_ros",
    "config",
    "faults",
    "msg_defs",
    "safety_case",
    "scripts",
    "sitl",
    "test",
)


def create_config() -> ProjectConfig:
    """What it looks for."""
    return ProjectConfig(
        project_title="chute_ros: input to a safety case, not a certificate",
        project_features=[
            "TABLE_SCREEN",
            "TRACEABILITY_SCREEN",
            "DEEP_TRACEABILITY_SCREEN",
            "TRACEABILITY_MATRIX_SCREEN",
            "REQUIREMENT_TO_SOURCE_TRACEABILITY",
            "SEARCH",
            "HTML2PDF",
        ],
        source_root_path="..",
        custom_css_path="case.css",
        include_source_paths=["/*.toml", *(f"/{folder}/**" for folder in FOLDERS)],
    )
