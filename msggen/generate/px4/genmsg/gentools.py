"""Type names from file names."""


def compute_full_type_name(package_name: str, file_name: str) -> str:
    """Return `px4/EscReport` for `EscReport.msg`. Raises ValueError for another kind of file."""
    if not file_name.endswith(".msg"):
        raise ValueError(f"'{file_name}' is not a .msg file")
    return f"{package_name}/{file_name[: -len('.msg')]}"
