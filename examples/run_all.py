"""Run every example, and every Python block of the README and the docs; `make check` does this."""

import os
import re
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).parent.parent
BLOCK = re.compile(r"^```python\n(.*?)^```", re.DOTALL | re.MULTILINE)


def main() -> int:
    """Run them in fresh processes, from the root; returns how many failed."""
    jobs = [
        (path.name, path.read_text()) for path in sorted(Path(__file__).parent.glob("[0-9]*.py"))
    ]
    for page in [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]:
        blocks = BLOCK.findall(page.read_text())
        if blocks:
            jobs.append((str(page.relative_to(ROOT)), "\n".join(blocks)))
    failed = 0
    with tempfile.TemporaryDirectory() as folder:
        for name, source in jobs:
            script = Path(folder) / "example.py"
            script.write_text(source)
            done = subprocess.run(
                [sys.executable, "-W", "error", str(script)],
                cwd=ROOT,
                env=os.environ | {"PEAKFLIGHT_EXAMPLES": folder},
                capture_output=True,
                text=True,
                check=False,
            )
            print(f"{'ok    ' if done.returncode == 0 else 'FAILED'} {name}")
            if done.returncode != 0:
                failed += 1
                print(done.stdout, done.stderr, sep="\n")
    return failed


if __name__ == "__main__":
    sys.exit(main())
