#!/usr/bin/env python3
"""The table of docs/CHECKS.md: what the files of tests promise, and what they cost in the last run of `make test`.

It reads what unit, e2e, python, pages, firmware-test and browser left in target/parts.
"""

import re
import xml.etree.ElementTree as xml
from collections import defaultdict
from pathlib import Path

from parts import processor

REPOSITORY = Path(__file__).resolve().parents[1]
PARTS = REPOSITORY / "target/parts"
PAGE = REPOSITORY / "docs/CHECKS.md"
OF_PYTEST = ["e2e", "python", "pages", "firmware-test"]
#: Files that cost less are one row of each part, s.
LEAST = 10


def promise(path):
    """The first sentence of a file."""
    text = path.read_text()
    found = re.match(r'(?:#!.*\n)?(?:r?"""|//! |/\*\* |// )((?:.|\n(?!\n))+?)(?:\.\s|\.$|:\s|\n\n|"""|\*/)', text)
    return " ".join(re.sub(r"\n(?://!|//| \*)? ?", " ", found[1]).split()).rstrip(".") if found else ""


def of_pytest(part):
    """Tests, seconds and seconds of the processor of each file."""
    rows = defaultdict(lambda: [0, 0.0, 0.0])
    for case in xml.parse(PARTS / f"{part}.xml").iter("testcase"):
        # A class in the file may be behind it.
        name = Path(case.get("classname").replace(".", "/") + ".py")
        file = next((it for it in (name, name.parent.with_suffix(".py")) if (REPOSITORY / it).exists()), name)
        row = rows[str(file)]
        used = [it.get("value") for it in case.iter("property") if it.get("name") == "processor"]
        row[0] += 1
        row[1] += float(case.get("time"))
        row[2] += sum(map(float, used))
    return rows


def of_cargo():
    rows = defaultdict(lambda: [0, 0.0, 0.0])
    crates = [it.parent for it in REPOSITORY.glob("**/Cargo.toml") if "target" not in it.parts]
    log = (PARTS / "unit.log").read_text()
    for run in re.split(r"^ +(?=Running |Doc-tests )", log, flags=re.M)[1:]:
        file, program = re.match(r"Running (?:unittests )?(\S+) \(\S*/(\w+)-\w+\)|Doc-tests (\w+)", run).group(1, 2)
        ends = re.search(r"(\d+) passed;.*finished in ([\d.]+)s", run)
        if not (file and ends):
            continue
        own = [it for it in crates if (it / file).exists() and program in (Path(file).stem, Path(file).parent.name, crate(it))]
        row = rows[str((own[0] / file).relative_to(REPOSITORY)) if own else program]
        row[0] += int(ends[1])
        row[1] += float(ends[2])
        row[2] += processor(run)
    return rows


def crate(folder):
    return re.search(r'^name = "(.*)"', (folder / "Cargo.toml").read_text(), re.M)[1].replace("-", "_")


def of_playwright():
    rows = defaultdict(lambda: [0, 0.0, 0.0])
    for file, time, unit in re.findall(r"› (tests/[\w/.-]+\.ts):.* \(([\d.]+)(ms|s|m)\)", (PARTS / "browser.log").read_text()):
        row = rows[f"web/{file}"]
        row[0] += 1
        row[1] += float(time) * {"ms": 0.001, "s": 1, "m": 60}[unit]
    return rows


def main():
    parts = {"unit": of_cargo(), **{part: of_pytest(part) for part in OF_PYTEST}, "browser": of_playwright()}
    lines = ["| file | part | tests | seconds | of the processor | promise |", "|---|---|--:|--:|--:|---|"]
    for part, rows in parts.items():
        dear = {file: row for file, row in rows.items() if row[1] >= LEAST}
        cheap = [row for file, row in rows.items() if file not in dear]
        shown = sorted(dear.items(), key=lambda it: -it[1][1])
        shown.append((f"{len(cheap)} other files", [sum(column) for column in zip(*cheap)] if cheap else [0, 0, 0]))
        for file, (tests, seconds, used) in shown:
            path = REPOSITORY / file
            name = f"`{file}`" if path.exists() else file
            said = promise(path) if path.exists() else ""
            processor = f"{used:.0f}" if used else ""
            lines.append(f"| {name} | `{part}` | {tests} | {seconds:.0f} | {processor} | {said} |")
    head, begin, rest = PAGE.read_text().partition("<!-- tests/table.py -->\n")
    _, end, tail = rest.partition("<!-- end -->\n")
    PAGE.write_text(head + begin + "\n".join(lines) + "\n" + end + tail)


if __name__ == "__main__":
    main()
