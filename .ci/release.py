"""What a build's outputs become: the published parts' names, and the files of a release.  Standard library only.

    python3 .ci/release.py parts OUTPUTS             the parts with a report, as JSON
    python3 .ci/release.py assets OUTPUTS ASSETS TAG an archive a published part, its STEP and its report, the
                                                     bill of materials, SHA256SUMS

Parts that were rejected and drafts are told and left out; the former go into an artifact of their own.
"""

import json
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / "pipeline/app"))      # not through the package, which wants an environment

from release import fault, with_report, write_assets  # noqa: E402


def main(arguments):
    if arguments[:1] == ["parts"] and len(arguments) == 2:
        print(json.dumps(with_report(arguments[1])))
    elif arguments[:1] == ["assets"] and len(arguments) == 4:
        if wrong := fault(arguments[1]):
            sys.exit(wrong)
        print("\n".join(write_assets(*arguments[1:], ROOT / "requirements.lock")))
    else:
        sys.exit(__doc__)


if __name__ == "__main__":
    main(sys.argv[1:])
