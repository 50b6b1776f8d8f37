"""Writes docs/commands.md from the declarations of the commands, whose docstrings are their help too."""

from pathlib import Path

from ddf.cli.frame import COMMANDS, ROOMS

OUT = Path(__file__).with_suffix(".md")
INTRODUCTION = """# Commands

- `ddf COMMAND --help` tells the arguments of a command, with examples.
- A result is a short table and a line that sums it up, or one JSON object by `--json`. What is not known is – or null.
- Exit code 2: bad input, told in one line on standard error. 1: done, but doubtful: a network's fit that the clock cut
  short, a fit to frames that do not agree, or `ddf doctor` where something is missing.
- The folder of an output file must exist, or add `--make-folders`. An OUT_DIR is made.
- Completion in bash and zsh: `eval "$(register-python-argcomplete ddf)"`.
"""


def text() -> str:
    """The page: a section of each command by room, its text and its first example."""
    parts = [INTRODUCTION]
    for room, title in ROOMS.items():
        parts.append(f"## {title.capitalize()}\n")
        for name, command in COMMANDS.items():
            if command.room == room:
                told, _, examples = command.docstring
                parts.append(f"### ddf {name}\n\n{told}\n\n```sh\n{examples[0]}\n```\n")
    return "\n".join(parts)


if __name__ == "__main__":
    OUT.write_text(text(), encoding="utf-8")
