"""Writes the reference in docs/PYTHON.md from the installed package: `make python-docs`."""

from __future__ import annotations

import ast
import functools
import inspect
import re
import textwrap
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType
from typing import Any

import motorlink
from conftest import REPOSITORY
from motorlink import _core, aio, can, errors, recording, rmd, sim, st

PAGE = REPOSITORY / "docs" / "PYTHON.md"
MARK = "<!-- `make python-docs` writes everything below this line. -->\n"
MODULES = [motorlink, st, rmd, aio, aio.st, aio.rmd, can, recording, sim, errors]
#: What has the same arguments or methods, without `await`.
BLOCKING: dict[Any, Any] = {
    aio.st.open: st.open,
    aio.st.scan: st.scan,
    aio.rmd.open: rmd.open,
    aio.Sampling: motorlink.Sampling,
    aio.Settings: motorlink.Settings,
    aio.st.Client: st.Client,
    aio.st.Motor: st.Motor,
    aio.rmd.Client: rmd.Client,
    aio.rmd.Motor: rmd.Motor,
}
#: Private names of types, as a reader knows them.
TYPES = {
    "CanPort": "can.CanPort",
    "ClientT": "Client",
    "MotorT": "Motor",
    "Path": "str | PathLike",
    "PortLike": "str | PathLike | Bench",
    "PortT": "str | PathLike | Bench",
    "RmdRequest": "Request",
    "Samples": "numpy.ndarray",
    "SamplingT": "Sampling",
    "SettingsSource": "str | SettingsDump | PathLike",
    "Self": "Request",
    "Source": "str | PathLike",
    "StRequest": "Request",
}
WIDTH = 100


class Bare(str):
    """An annotation that a signature shows without quotes."""

    __slots__ = ()
    __repr__ = str.__str__


def types(text: str) -> str:
    """Annotations with public names."""
    for private, public in TYPES.items():
        text = re.sub(rf"(?<![.\w\"'`]){private}\b", public, text)
    return text


@functools.cache
def stub() -> dict[str, dict[str, ast.FunctionDef]]:
    """The functions of the classes of the extension module, with their types."""
    text = Path(_core.__file__).with_name("_core.pyi").read_text()
    classes = [node for node in ast.parse(text).body if isinstance(node, ast.ClassDef)]
    return {
        one.name: {node.name: node for node in one.body if isinstance(node, ast.FunctionDef)}
        for one in classes
    }


def stubs(owner: type | None) -> dict[str, ast.FunctionDef]:
    """The functions of a class of the extension module; empty for another class."""
    if owner is None or owner.__module__ != _core.__name__:
        return {}
    return stub()[owner.__name__]


def signature(function: Any, owner: type | None) -> str:
    """The arguments and the result of a function."""
    typed = stubs(owner).get(function.__name__)
    if typed is not None and typed.returns is not None:
        arguments = re.sub(r"^(self|cls)(, )?", "", ast.unparse(typed.args)).replace("'", '"')
        arguments = re.sub(r"(: [^,=]+)=", r"\1 = ", arguments)
        return types(f"({arguments}) -> {ast.unparse(typed.returns)}")
    found = inspect.signature(function)
    parameters = [
        parameter.replace(annotation=Bare(parameter.annotation))
        if isinstance(parameter.annotation, str)
        else parameter
        for name, parameter in found.parameters.items()
        if name not in ("self", "cls")
    ]
    result = found.return_annotation
    if isinstance(result, str):
        result = Bare(result)
    text = str(found.replace(parameters=parameters, return_annotation=result))
    return types(text.replace("'", '"'))


def returned(attribute: Any, name: str, owner: type) -> str:
    """The type of an attribute."""
    typed = stubs(owner).get(name)
    if typed is not None and typed.returns is not None:
        return types(f": {ast.unparse(typed.returns)}")
    return types(f": {inspect.signature(attribute.fget).return_annotation}")


def paragraphs(thing: object) -> list[str]:
    """The docstring without its examples."""
    text = inspect.getdoc(thing) or ""
    return [one for one in re.split(r"\n\s*\n", text) if ">>>" not in one and "::" not in one]


def markdown(text: str) -> str:
    """A docstring's markup as Markdown."""
    text = re.sub(r":\w+:`~?(?:motorlink\.)?([^`]+)`", r"`\1`", text)
    return text.replace("``", "`")


def brief(thing: object) -> str:
    """The first paragraph, the command, and the errors."""
    first, *others = paragraphs(thing) or [""]
    kept = [first]
    for one in others:
        if one.startswith("0x"):
            kept.append(one)
        elif found := re.search(r"(^|(?<=\.\s))Raises .*", one, re.S):
            kept.append(found[0])
    return markdown(" ".join(" ".join(kept).split()))


def item(text: str) -> str:
    """An item of a list."""
    return "- " + textwrap.indent(wrapped(text, WIDTH - 2), "  ").strip()


def filled(text: str) -> str:
    """A paragraph."""
    return wrapped(text, WIDTH) + "\n"


def wrapped(text: str, width: int) -> str:
    return textwrap.fill(text, width, break_long_words=False, break_on_hyphens=False)


def whole(thing: object) -> Iterator[str]:
    """The docstring as Markdown; a definition list becomes a list."""
    for paragraph in paragraphs(thing):
        lines = markdown(paragraph).split("\n")
        if any(line.startswith("    ") for line in lines):
            entry = ""
            for line in lines:
                if line.startswith("    "):
                    entry += f" {line.strip()}"
                else:
                    if entry:
                        yield item(entry)
                    entry = f"{line}:"
            yield item(entry) + "\n"
        elif lines[0].startswith(("* ", "- ")):
            for one in re.split(r"\n[*-] ", "\n" + "\n".join(lines))[1:]:
                yield item(" ".join(one.split()))
            yield ""
        else:
            yield filled(" ".join(lines))


def fields(kind: type) -> Iterator[tuple[str, str]]:
    """The annotated attributes of a class, with the comments above them."""
    try:
        text = textwrap.dedent(inspect.getsource(kind))
    except (OSError, TypeError):
        return
    lines = text.split("\n")
    for node in ast.parse(text).body[0].body:  # type: ignore[attr-defined]
        if not isinstance(node, ast.AnnAssign) or not isinstance(node.target, ast.Name):
            continue
        name, annotation = node.target.id, ast.unparse(node.annotation)
        if name.startswith("_"):
            continue
        comment: list[str] = []
        above = node.lineno - 2
        while lines[above].strip().startswith("#:"):
            comment.insert(0, lines[above].strip().removeprefix("#:").strip())
            above -= 1
        typed = f"`{name}: {types(annotation)}`"
        yield name, markdown(": ".join([typed, " ".join(comment)]) if comment else typed)


def members(kind: type) -> Iterator[str]:
    """The public attributes and methods of a class, a line each."""
    found: dict[str, type] = {}
    for owner in reversed(kind.__mro__):
        if owner.__module__.startswith("motorlink"):
            # The order of the members of extension classes differs from process to process.
            names = stubs(owner) or vars(owner)
            found.update(dict.fromkeys([*names, *dict(fields(owner))], owner))
    known = {name: text for owner in kind.__mro__ for name, text in fields(owner)}
    plain = BLOCKING.get(kind)
    for name, owner in found.items():
        # The attributes of all exceptions are listed once.
        if name.startswith("_") or (issubclass(kind, BaseException) and owner is not kind):
            continue
        if name in known:
            yield item(known[name])
            continue
        member = inspect.getattr_static(kind, name)
        value = getattr(kind, name, member)
        if plain and inspect.getdoc(value) == inspect.getdoc(getattr(plain, name)):
            continue
        if inspect.isdatadescriptor(member):
            yield item(f"`{name}{returned(member, name, owner)}`: {brief(value)}")
        elif callable(value):
            yield item(f"`{name}{signature(value, owner)}`: {brief(value)}")


def bases(kind: type) -> str:
    """What else an instance is."""
    names = [base.__name__ for base in kind.__mro__[1:-1] if not base.__name__.startswith("_")]
    return ", ".join(f"`{name}`" for name in names if name not in ("Exception", "BaseException"))


def entry(module: ModuleType, name: str, thing: Any) -> Iterator[str]:
    """What a module offers under a name."""
    called = f"{module.__name__}.{name}"
    yield f"\n#### {called.removeprefix('motorlink.')}\n"
    if inspect.isclass(thing):
        yield from whole(thing)
        if issubclass(thing, BaseException):
            if others := bases(thing):
                yield filled(f"It is also: {others}.")
        if thing in BLOCKING:
            yield f"Its methods are those of `{path(BLOCKING[thing])}`. Exchanges are awaited.\n"
        yield from members(thing)
    elif thing in BLOCKING.keys():
        result = signature(thing, None).rpartition(" -> ")[2]
        yield f"The arguments are those of `{path(BLOCKING[thing])}`. Returns `{result}`.\n"
    elif callable(thing):
        yield filled(f"`{name}{signature(thing, None)}`")
        yield from whole(thing)
    else:
        yield filled(", ".join(f"`{one}`" for one in thing))


def path(thing: Any) -> str:
    """The name of a class or function as programs write it."""
    module = thing.__module__.removeprefix("motorlink.")
    return thing.__name__ if module.startswith("_") else f"{module}.{thing.__name__}"


def reference() -> str:
    """The reference as Markdown."""
    seen: dict[int, str] = {}
    out: list[str] = []
    for module in MODULES:
        out.append(f"\n### {module.__name__}\n")
        elsewhere, requests, modules = [], [], []
        for name in dir(module):
            thing = getattr(module, name)
            if inspect.ismodule(thing):
                modules.append(f"`{name}`")
            elif name == "__version__":
                out += [f"\n#### {name}\n", "The version of the package.\n"]
            elif inspect.isclass(thing) and thing.__module__ in MODULE_NAMES - {module.__name__}:
                elsewhere.append(f"`{name}`")
            elif id(thing) in seen:
                elsewhere.append(f"`{name}`")
            elif getattr(getattr(module, "Request", None), name, None) is thing:
                requests.append(f"`{name}`")
            else:
                seen[id(thing)] = name
                out += entry(module, name, thing)
        for begin, names in (
            ("Modules:", modules),
            ("Described elsewhere on this page:", elsewhere),
            ("Functions that are methods of `Request`:", requests),
        ):
            if names:
                out.append("\n" + filled(f"{begin} {', '.join(names)}."))
    text = "\n".join(line.rstrip() for line in "\n".join(out).split("\n"))
    return re.sub(r"\n{3,}", "\n\n", text).strip() + "\n"


MODULE_NAMES = {module.__name__ for module in MODULES}


def page() -> str:
    """The page with a new reference."""
    return PAGE.read_text().partition(MARK)[0] + MARK + "\n" + reference()


if __name__ == "__main__":
    PAGE.write_text(page())
