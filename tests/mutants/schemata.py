"""Many mutants in one build.

A function that has mutants becomes

    fn f() -> u8 { if crate::mutants::on(7) { its body with the fault } else { its body } }

and the variable MUTANT chooses one when a process begins. With MUTANTS_REACHED, a folder, each process writes into
a file there which mutants it reached, and the test of pytest that started it. A mutant that does not compile in
this form is left out: nearly all of them do not compile at all, the others are in `const fn`.
"""

import json
import random
import re
import subprocess
from collections import Counter, defaultdict

CRATES = ["proto", "motorlink", "link", "telemetry", "recording", "capture", "cli", "fleet", "monitor"]
#: The module that each crate with mutants gets.
MODULE = """
mod mutants {
    extern crate std;
    use std::format;
    use std::io::Write;
    use std::sync::OnceLock;
    use std::sync::atomic::{AtomicBool, Ordering};

    static CHOSEN: OnceLock<(usize, Option<std::ffi::OsString>)> = OnceLock::new();
    static REACHED: [AtomicBool; COUNT] = [const { AtomicBool::new(false) }; COUNT];

    pub(crate) fn on(number: usize) -> bool {
        let (chosen, folder) = CHOSEN.get_or_init(|| {
            let number = std::env::var("MUTANT").ok().and_then(|it| it.parse().ok());
            (number.unwrap_or(0), std::env::var_os("MUTANTS_REACHED"))
        });
        if let Some(folder) = folder
            && !REACHED[number].swap(true, Ordering::Relaxed)
        {
            let path = std::path::Path::new(folder).join(format!("{}", std::process::id()));
            let test = std::env::var("PYTEST_CURRENT_TEST").unwrap_or_default();
            if let Ok(mut file) = std::fs::OpenOptions::new().create(true).append(true).open(path) {
                let _ = file.write_all(format!("{number} {test}\\n").as_bytes());
            }
        }
        number == *chosen
    }
}
"""


def output(*command, cwd):
    return subprocess.run(command, cwd=cwd, capture_output=True, text=True, check=True).stdout


def checkout(repository, tree):
    """The committed files once more, with a build of their own."""
    if not tree.exists():
        output("git", "clone", "--quiet", "--shared", str(repository), str(tree), cwd=repository)
    output("git", "fetch", "--quiet", "origin", cwd=tree)
    head = output("git", "rev-parse", "HEAD", cwd=repository).strip()
    output("git", "checkout", "--quiet", "--force", "--detach", head, cwd=tree)


def restore(tree):
    output("git", "checkout", "--quiet", "--force", "--", ".", cwd=tree)


def sample(tree, seed, count, names):
    """Makes mutants, numbered from 1: those with these names, or a sample that is drawn. Names have no lines, which
    change with each commit."""
    crates = [argument for crate in CRATES for argument in ("--file", f"crates/{crate}/src/**/*.rs")]
    listed = json.loads(output("cargo", "mutants", "--list", "--json", *crates, cwd=tree))
    seen, mutants = Counter(), {}
    for it in listed:
        name = re.sub(r":\d+:\d+:", ":", it["name"])
        seen[name] += 1
        if it["function"] and not it["file"].endswith("/main.rs"):
            name = f"{name} #{seen[name]}"
            mutants[name] = {**it, "name": name}
    for name in set(names) - set(mutants):
        print(f"the code is not there any more: {name}")
    # A fifth does not compile.
    drawn = random.Random(seed).sample(list(mutants), count * 3 // 2)
    left = [mutants[name] for name in names or drawn if name in mutants]
    while failed := make(tree, left):
        print(f"{len(failed)} of {len(left)} mutants do not compile", flush=True)
        left = [it for it in left if it["name"] not in failed]
    if len(left) > count and make(tree, left := left[:count]):
        raise SystemExit("a part of the mutants does not compile alone")
    return left


def make(tree, mutants):
    """Writes them into the files. Gives the names of those that do not compile."""
    restore(tree)
    numbers = {it["name"]: number for number, it in enumerate(mutants, 1)}
    of_file = defaultdict(list)
    for it in mutants:
        of_file[it["file"]].append(it)
    lines, failed = {}, set()
    for file, theirs in of_file.items():
        text, lines[file], inner = with_mutants(tree.joinpath(file).read_text(), theirs, numbers)
        tree.joinpath(file).write_text(text)
        failed |= inner
    for crate in {file.split("/")[1] for file in of_file}:
        with open(tree / f"crates/{crate}/src/lib.rs", "a") as file:
            file.write(MODULE.replace("COUNT", str(len(mutants) + 1)))
    packages = sorted({it["package"] for it in mutants})
    done = subprocess.run(
        ["cargo", "check", "--locked", "--keep-going", "--all-features", "--message-format=json"]
        + [argument for it in packages for argument in ("-p", it)],
        cwd=tree, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True,
    )  # fmt: skip
    messages = [json.loads(line).get("message") or {} for line in done.stdout.splitlines()]
    errors = [it for it in messages if it.get("level") == "error" and it["spans"]]
    for error in errors:
        primary = next(it for it in error["spans"] if it["is_primary"])
        at, places = primary["line_start"], lines.get(primary["file_name"], [])
        # The smallest of the places that have the line: one mutant, or all of a function.
        inside = [it for it in places if it[0] <= at <= it[1]]
        if not inside:
            raise SystemExit(error["rendered"])
        failed |= min(inside, key=lambda it: it[1] - it[0])[2]
    if done.returncode and not failed:
        raise SystemExit("cargo check failed without an error")
    return failed


def with_mutants(text, mutants, numbers):
    """The text of a file with its mutants, the lines of each (first, last, names), and those that are left out."""
    begins = [0]
    for line in text.splitlines(keepends=True):
        begins.append(begins[-1] + len(line))

    def offset(place):
        return begins[place["line"] - 1] + place["column"] - 1

    functions = defaultdict(list)
    for it in mutants:
        span = it["function"]["span"]
        functions[offset(span["start"]), offset(span["end"])].append(it)
    out, places, inner, last = [], [], set(), 0
    line = 1

    def write(piece):
        nonlocal line
        out.append(piece)
        line += piece.count("\n")

    for (start, end), theirs in sorted(functions.items()):
        # It is in another function with mutants, whose text has moved.
        if start < last:
            inner |= {it["name"] for it in theirs}
            continue
        head = re.search(r"^(?!\s*//)[^\n]*?\bfn\s", text[start:end], re.M)
        begin = text.index("{", start + head.end())
        body = text[begin:end]
        write(text[last:begin] + "{\n")
        first = line
        for it in theirs:
            at, to = offset(it["span"]["start"]), offset(it["span"]["end"])
            write(f"if crate::mutants::on({numbers[it['name']]}) ")
            own = line
            changed = text[begin:at] + it["replacement"] + text[to:end]
            write(f"{changed}\n")
            places.append((own, line - 1, {it["name"]}))
            write("else ")
        write(f"{body}\n}}")
        places.append((first, line, {it["name"] for it in theirs}))
        last = end
    write(text[last:])
    return "".join(out), places, inner
