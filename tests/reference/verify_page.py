"""A minimal page with an embedded log and the script that verifies it, under a strict Content-Security-Policy."""

from base64 import b64encode
from hashlib import sha256

from rtshcua.ground.flight.embedding import script

STYLE = "body { font-family: sans-serif; max-width: 60em; margin: auto; overflow-wrap: anywhere }"
#: gives a test the functions of the script
HOOK = "\nglobalThis.tested = { embedded, verifyLog, verifyRedacted, signerOf, signatureCounts };\n"


def _csp(text: str) -> str:
    return f"'sha256-{b64encode(sha256(text.encode()).digest()).decode()}'"


def page(embedded: str, *, redacted: bool = False, hook: bool = False) -> str:
    """The page with the text of a log (`embedding.embed`)."""
    module = "\n" + script() + (HOOK if hook else "")
    permitted = f"default-src 'none'; script-src {_csp(module)}; style-src {_csp(STYLE)}"
    return f"""<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta http-equiv="Content-Security-Policy" content="{permitted}; base-uri 'none'; form-action 'none'">
<meta name="viewport" content="width=device-width, initial-scale=1">
<meta name="color-scheme" content="light dark">
<title>Verification</title>
<style>{STYLE}</style>
</head>
<body>
<main>
<h1>Verification</h1>
<p><label for="pinned-key">Root key</label> <input id="pinned-key" autocomplete="off" spellcheck="false"></p>
<p><label for="pinned-file">or its file</label> <input id="pinned-file" type="file"></p>
<p><button id="verify" type="button">Verify</button> <strong id="badge" role="status" aria-live="polite"></strong></p>
<div id="verification"></div>
</main>
<script type="application/gzip+base64" id="{"redacted-log" if redacted else "log"}">{embedded}</script>
<script type="module">{module}</script>
</body>
</html>
"""
