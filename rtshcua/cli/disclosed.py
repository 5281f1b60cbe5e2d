"""The fields from which records are shown in part: whether the close of a log states those of its own records."""

from itertools import islice
from pathlib import Path

from rtshcua.adapters.files.logs import SECRET, SecretError, lines, read_secret
from rtshcua.adapters.store.reading import open_regular
from rtshcua.cli.beside import run_folder
from rtshcua.evidence.finding import Claim, Finding
from rtshcua.evidence.proofs.disclosure import disclosure_root
from rtshcua.evidence.report import Report
from rtshcua.ground.auditor.audit import failing

_FIELDS = "the fields which the close states, to show records in part, are those of the records"


def disclosed(report: Report, log: Path, *, audited: bool) -> Report:
    """The report, with what it says of the root in the close; an audit works it out again with the run's secret.

    No seal binds that root: whoever signs the close states it, of all records.
    """
    close = report.close
    if close is None or close.disclosure is None or report.failure is not None:
        return report
    if not audited:
        return _unproven(report, f"`--audit` works them out again from `{SECRET}`")
    folder = run_folder(log)
    if folder is None or not (folder / SECRET).exists():
        return _unproven(report, f"`{SECRET}` does not lie beside the log")
    try:
        secret = read_secret(folder / SECRET, folder)
    except SecretError as error:
        return _unproven(report, str(error))
    except OSError as error:
        return _unproven(report, f"`{SECRET}` cannot be read: {error.strerror}")
    with open_regular(log) as file:
        root = disclosure_root(islice(lines(file), close.seq), secret).hex()
        end = file.tell()
    if root == close.disclosure:
        return report._replace(proven=(*report.proven, Claim("disclosure", f"{_FIELDS}: worked out from `{SECRET}`")))
    text = f"the close states other fields than those of the records, to show them in part, or `{SECRET}` is another's"
    return failing(report, Finding("close/disclosure", close.seq, text, close.disclosure, root, end))


def _unproven(report: Report, why: str) -> Report:
    return report._replace(unproven=(*report.unproven, Claim("disclosure", f"that {_FIELDS}: {why}")))
