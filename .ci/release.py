"""What a build's outputs become: the published parts' names, and the files of a release.  Standard library only.

    python3 .ci/release.py parts OUTPUTS             the parts with a report, as JSON
    python3 .ci/release.py assets OUTPUTS ASSETS TAG an archive a published part, its STEP and its report, the
                                                     bill of materials, SHA256SUMS

Parts that were rejected and drafts are told and left out; the former go into an artifact of their own.
"""

import hashlib
import json
import re
import shutil
import sys
from pathlib import Path

REJECTED, DRAFT = "-rejected", "-draft"
LOCK = Path(__file__).resolve().parents[1] / "requirements.lock"
PINNED = re.compile(r"^([A-Za-z0-9][A-Za-z0-9._-]*)==([^ ;\\]+)", re.M)


def published(outputs):
    """Folders of the published parts, by name; drafts prove nothing."""
    return [p.parent for p in sorted(Path(outputs).glob("*/manifest.json")) if not p.parent.name.endswith((REJECTED, DRAFT))]


def materials(lock):
    """Text of a CycloneDX bill of materials: every package of the lock with the SHA-256 of its files."""
    text = lock.read_text(encoding="utf-8")
    starts = [*(m.start() for m in PINNED.finditer(text)), len(text)]
    parts = []
    for found, end in zip(PINNED.finditer(text), starts[1:]):
        hashes = re.findall(r"sha256:([0-9a-f]{64})", text[found.start():end])
        parts.append({"type": "library", "name": found[1], "version": found[2], "purl": f"pkg:pypi/{found[1].lower()}@{found[2]}",
                      "hashes": [{"alg": "SHA-256", "content": h} for h in hashes]})
    return json.dumps({"bomFormat": "CycloneDX", "specVersion": "1.5", "version": 1, "components": parts}, indent=1) + "\n"


def with_report(outputs):
    """Names of the published parts that have a report; a bare solid has none."""
    return [folder.name for folder in published(outputs) if (folder / "report.html").is_file()]


def write_assets(outputs, assets, tag):
    """Put a release's files into a folder.

    Returns:
        Lines that tell what was put in and what was left out.
    """
    assets = Path(assets)
    assets.mkdir(parents=True)
    said = []
    for folder in published(outputs):
        part = folder.name
        shutil.make_archive(str(assets / f"{part}-{tag}"), "zip", Path(outputs).resolve(), part)
        files = [(folder / name, assets / f"{part}-{tag}{suffix}") for name, suffix in (
            (f"{part}.step", ".step"), ("report.html", ".html"))]
        there = [(source, target) for source, target in files if source.is_file()]
        for source, target in there:
            shutil.copyfile(source, target)
        said.append(f"{part}: archive" + "".join(f", {source.name}" for source, _ in there))
    said += [f"{p.name}: left out" for end in (REJECTED, DRAFT) for p in sorted(Path(outputs).glob(f"*{end}"))]
    (assets / "SBOM.cdx.json").write_text(materials(LOCK), encoding="utf-8")
    sums = [f"{hashlib.sha256(p.read_bytes()).hexdigest()}  {p.name}" for p in sorted(assets.iterdir())]
    (assets / "SHA256SUMS").write_text("".join(f"{line}\n" for line in sums), encoding="utf-8")
    return said


def main(arguments):
    if arguments[:1] == ["parts"] and len(arguments) == 2:
        print(json.dumps(with_report(arguments[1])))
    elif arguments[:1] == ["assets"] and len(arguments) == 4:
        said = write_assets(*arguments[1:])
        print("\n".join(said))
        if not published(arguments[1]):
            sys.exit(f"{arguments[1]} holds no published part: there is nothing to release")
    else:
        sys.exit(__doc__)


if __name__ == "__main__":
    main(sys.argv[1:])
