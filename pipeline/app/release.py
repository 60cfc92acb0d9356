"""What a build's outputs become: the files of a release.  Standard library alone: CI runs it without an environment.

An archive a published part, its STEP and its report beside it, a bill of materials, SHA256SUMS over all of them.  What was
rejected, drafts, and builds that stopped before a verdict, are told and left out.
"""

import hashlib
import json
import re
import shutil
from pathlib import Path

REJECTED, DRAFT = "-rejected", "-draft"
PINNED = re.compile(r"^([A-Za-z0-9][A-Za-z0-9._-]*)==([^ ;\\]+)", re.M)
WHEEL = re.compile(r"([A-Za-z0-9_.]+)-([^-]+)-.*\.whl")
TAG = re.compile(r"[A-Za-z0-9][A-Za-z0-9._-]*")


def published(outputs):
    """Folders of the published parts, by name: verified programs, and solids that were checked."""
    return [folder for folder in _built(outputs) if not folder.name.endswith((REJECTED, DRAFT)) and _is_proven(folder)]


def _built(outputs):
    return [p.parent for p in sorted(Path(outputs).glob("*/manifest.json"))]


def _is_proven(folder):
    """Whether a verdict stands beside it; a build that stopped before one, at its STEP or its programs, proves nothing."""
    verify = folder / "verify.json"
    return json.loads(verify.read_text())["ok"] is True if verify.is_file() else (folder / "solid.json").is_file()


def fault(outputs):
    """What stands against a release of a folder of outputs, in a sentence; "" nothing."""
    if not published(outputs):
        return f"{outputs} holds no published part: there is nothing to release; build one first"
    for folder in published(outputs):
        files = json.loads((folder / "manifest.json").read_text()).get("files", {})
        other = [name for name, sha in files.items() if not (folder / name).is_file() or _sha256(folder / name) != sha]
        if other:
            return f"{folder}: {', '.join(other)}: not as manifest.json has it, edited or lost after the build; build it again"
    return ""


def with_report(outputs):
    """Names of the published parts that have a report; a bare solid has none."""
    return [folder.name for folder in published(outputs) if (folder / "report.html").is_file()]


def materials(lock):
    """Text of a CycloneDX bill of materials: every package of the lock, and the wheels in vendor/ beside it, with SHA-256.

    Args:
        lock: path of a requirements.lock with hashes.
    """
    text = lock.read_text(encoding="utf-8")
    starts = [*(m.start() for m in PINNED.finditer(text)), len(text)]
    parts = [_component("pypi", found[1], found[2], re.findall(r"sha256:([0-9a-f]{64})", text[found.start():end]))
             for found, end in zip(PINNED.finditer(text), starts[1:])]
    for wheel in sorted((lock.parent / "vendor").glob("*.whl")):
        if named := WHEEL.fullmatch(wheel.name):
            parts.append(_component("generic", named[1], named[2], [_sha256(wheel)]))
    return json.dumps({"bomFormat": "CycloneDX", "specVersion": "1.5", "version": 1, "components": parts}, indent=1) + "\n"


def _component(kind, name, version, hashes):
    return {"type": "library", "name": name, "version": version, "purl": f"pkg:{kind}/{name.lower()}@{version}",
            "hashes": [{"alg": "SHA-256", "content": h} for h in hashes]}


def _sha256(path):
    return hashlib.sha256(path.read_bytes()).hexdigest()


def write_assets(outputs, assets, tag, lock):
    """Put a release's files into a folder that is not there yet.

    Args:
        outputs: folder of builds.   assets: the new folder.   tag: of the release, in every name.   lock: path; None: no bill.
    Returns:
        lines that tell what was put in and what was left out.
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
    said += [f"{p.name}: left out, not verified" for p in _built(outputs)
             if not p.name.endswith((REJECTED, DRAFT)) and not _is_proven(p)]
    if lock is not None:
        (assets / "SBOM.cdx.json").write_text(materials(lock), encoding="utf-8")
    sums = [f"{_sha256(p)}  {p.name}" for p in sorted(assets.iterdir())]
    (assets / "SHA256SUMS").write_text("".join(f"{line}\n" for line in sums), encoding="utf-8")
    return said
