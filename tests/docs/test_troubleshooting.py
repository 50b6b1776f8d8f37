"""The messages that docs/troubleshooting.md explains are those of the code."""

import re
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
SOURCES = [*(ROOT / "src").rglob("*.py"), ROOT / ".ci" / "setup"]
FILLED_IN = r"torch: |\"directed-distance-fields\[torch\]\"|0\.0%|0\.01|\d+ steps|99\.5%|^no chair|`"  # by f-strings


def test_messages_are_those_of_the_code():
    page = (ROOT / "docs" / "troubleshooting.md").read_text(encoding="utf-8")
    messages = re.findall(r"(?m)^\| `([^`]+)` \|", page)
    assert len(messages) > 10
    code = re.sub(r'"\s*\n\s*f?"', "", "\n".join(source.read_text(encoding="utf-8") for source in SOURCES))
    for message in messages:
        for part in re.split(FILLED_IN, message):
            assert part.strip() in code, message
