"""Files by their URIs: what an editor calls a text, and the name that programs know it by."""

import re
from pathlib import Path
from urllib.parse import quote, unquote, urlsplit

from rtshcua.ground.language.paths import shown

_DRIVE = re.compile(r"/[A-Za-z]:(?=/|\Z)")


def name_of(uri: str) -> str:
    """The name of a text, as `shown` gives it. What is no file gets a name in the working folder that tells the URI."""
    return shown(path_of(uri) or re.sub(r"[\\/\0]+", "_", unquote(uri)))


def path_of(uri: str) -> str | None:
    """The path of a `file:` URI, also of Windows (`file:///c%3A/x.rts`); None for any other."""
    try:
        scheme, host, path, _, _ = urlsplit(uri)
    except ValueError:
        return None
    if scheme != "file" or "\0" in unquote(path):
        return None
    path = unquote(path)
    if _DRIVE.match(path):
        return path[1].lower() + path[2:]
    return f"//{host}{path}" if host and host != "localhost" else path


def uri_of(name: str) -> str:
    """The URI of a file by its name."""
    return "file://" + quote(Path(name).absolute().as_posix())
