"""`ddf config show NAME`: every setting of an experiment or a fit, whether its file gives it or not."""

import argparse
import dataclasses
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

EXAMPLES = ("ddf config show long_fit", "ddf config show paper_fit --json")
_WIDTH = 24  # of a value, from where on comments stand in a column


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare what is done, and the name."""
    parser.add_argument("action", choices=("show",), help="print it as a file with all settings, which says the same")
    parser.add_argument("name", metavar="NAME", help="a file, or the name of one: fit, simple_fit, long_fit, paper_fit")


def run(args: argparse.Namespace) -> dict[str, Any]:
    """Of fits; in a checkout `ddf_lab.commands` knows experiments too."""
    from ddf.core import config
    from ddf.fit import fit_settings

    file = config.found_file(args.name)
    return answer(file, {"fit": config.load(file, "fit", fit_settings.FitConfig)})


def answer(file: Path, sections: Mapping[str, Any]) -> dict[str, Any]:
    """The sections as JSON and as the text of a file, and what in them is not the default."""
    from ddf.core import config, schema

    every = [each for name, section in sections.items() for each in schema.listed(section, name)]
    changed = [each for each in every if each.value != each.default and not dataclasses.is_dataclass(each.value)]
    count = sum(not dataclasses.is_dataclass(each.value) for each in every)
    return {
        "config": file.as_posix(),
        "sections": {name: config.plain(section) for name, section in sections.items()},
        "changed": [each.key for each in changed],
        "table": list(_lines(sections)),
        "verdict": f"# {file}: {len(changed)} of {count} settings are not the default",
    }


def _lines(sections: Mapping[str, Any]) -> Iterator[str]:
    import yaml

    from ddf.core import schema

    def text(value: Any) -> str:
        plain = list(value) if isinstance(value, tuple) else value.as_posix() if isinstance(value, Path) else value
        return (
            yaml.safe_dump(plain, default_flow_style=True, sort_keys=False, allow_unicode=True, width=10_000)
            .removesuffix("\n...\n")
            .rstrip("\n")
        )

    for name, section in sections.items():
        yield f"{name}:"
        for each in schema.listed(section, name):
            part, depth = dataclasses.is_dataclass(each.value), each.key.count(".")
            own = f"{'  ' * depth}{each.key.rpartition('.')[2]}:{'' if part else f' {text(each.value)}'}"
            source = f" ({each.source})" if each.source else ""
            usual = each.default if not part else None if each.default is None else each.value
            said = f"{each.says}{source}" if each.value == usual else f"not {text(usual)}{source}: {each.says}"
            yield f"{own:{_WIDTH + 2 * depth}} # {said}"
