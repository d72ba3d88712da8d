# SPDX-License-Identifier: MIT
"""How an extra of Headturn is installed here. The distribution that holds these packages is on no index.

pip remembers where it had a distribution from (PEP 610): a checkout, a wheel; if it says nothing, an index.
"""

from __future__ import annotations

import json
from pathlib import Path
from urllib.parse import unquote, urlsplit

CHECKOUT = Path(__file__).resolve().parents[1]


def install_command(extra: str, name: str = "headturn") -> str:
    """The command line, for a message. name: of the distribution."""
    return f"pip install {_what(extra, name)}"


def install_with_these(extra: str) -> str:
    """The same for the distribution that brought these packages along: downstream-hpe, or a checkout."""
    from importlib.metadata import PackageNotFoundError, distribution

    try:
        distribution("downstream-hpe")
    except PackageNotFoundError:
        return install_command(extra)
    return install_command(extra, "downstream-hpe")


def numpy_clash(error: ImportError) -> str | None:
    """One line where numpy 1 stands beside a pyarrow for numpy 2, which pip allows; None of another error."""
    if "requires NumPy 2" not in str(error):
        return None
    return f"{error}: pip install 'pyarrow<22', as bpy and mediapipe 0.10.21 need numpy 1"


def _what(extra: str, name: str) -> str:
    # It takes as long as many other imports together, and is needed for messages alone.
    from importlib.metadata import PackageNotFoundError, distribution

    try:
        told = distribution(name).read_text("direct_url.json")
    except PackageNotFoundError:  # a checkout on PYTHONPATH
        return f"-e '{CHECKOUT}[{extra}]'"
    if told is None:
        return f"'{name}[{extra}]'"
    source = json.loads(told)
    url = str(source["url"])
    if "dir_info" in source:
        editable = "-e " if source["dir_info"].get("editable") else ""
        return f"{editable}'{unquote(urlsplit(url).path)}[{extra}]'"
    if "vcs_info" in source:
        vcs = source["vcs_info"]
        url = f"{vcs['vcs']}+{url}@{vcs['commit_id']}"
    return f"'{name}[{extra}] @ {url}'"
