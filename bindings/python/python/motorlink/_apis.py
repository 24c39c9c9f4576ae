"""Makes the blocking API and the asyncio API from one definition of each method.

A definition returns an exchange. A definition with several exchanges, or with work after one, is a
generator: it yields an exchange and receives its value. In the blocking API an exchange is its value,
in asyncio it is something to await.

>>> class Shared:
...     @both_apis
...     def twice(self, number: int) -> Exchanges[int]:
...         "Twice a number."
...         answer: int = yield self.ask(number)
...         return 2 * answer

>>> class Motor(Blocking, Shared):
...     def ask(self, number: int) -> int:
...         return number
>>> Motor().twice(3)
6

>>> import asyncio
>>> class AwaitedMotor(Awaited, Shared):
...     async def ask(self, number: int) -> int:
...         return number
>>> asyncio.run(AwaitedMotor().twice(3))
6
"""

from __future__ import annotations

import functools
import inspect
from collections.abc import Callable, Coroutine, Generator
from types import FunctionType
from typing import TYPE_CHECKING, Any, Generic, TypeVar, overload

Value = TypeVar("Value")
Function = TypeVar("Function", bound=Callable[..., Any])

#: A definition: its exchanges, and the value that the method returns.
Exchanges = Generator[Any, Any, Value]

if TYPE_CHECKING:
    from typing_extensions import Concatenate, ParamSpec

    Arguments = ParamSpec("Arguments")

    class Method(Generic[Arguments, Value]):
        """A definition as type checkers see it: one method for each API."""

        @overload
        def __get__(self, owner: Blocking, kind: Any) -> Callable[Arguments, Value]: ...
        @overload
        def __get__(
            self, owner: Awaited, kind: Any
        ) -> Callable[Arguments, Coroutine[Any, Any, Value]]: ...
        @overload
        def __get__(
            self, owner: None, kind: type[Blocking]
        ) -> Callable[Concatenate[Any, Arguments], Value]: ...
        @overload
        def __get__(
            self, owner: None, kind: type[Awaited]
        ) -> Callable[Concatenate[Any, Arguments], Coroutine[Any, Any, Value]]: ...
        def __get__(self, owner: Any, kind: Any) -> Any: ...


def both_apis(
    definition: Callable[Concatenate[Any, Arguments], Exchanges[Value]],
) -> Method[Arguments, Value]:
    """Marks a definition: each API makes its own method of it."""
    definition._both_apis = True  # type: ignore[attr-defined]
    return definition  # type: ignore[return-value]


def one(exchange: Any) -> Exchanges[Any]:
    """The value of one exchange, for a definition to return."""
    given: Exchanges[Any] = exchange
    return given


class Blocking:
    """A class of the blocking API: its methods return when their exchanges are complete."""

    __slots__ = ()

    def __init_subclass__(cls) -> None:
        super().__init_subclass__()
        _make(cls, blocking)


class Awaited:
    """A class of the asyncio API: its methods are coroutines."""

    __slots__ = ()

    def __init_subclass__(cls) -> None:
        super().__init_subclass__()
        _make(cls, awaited)


def blocking(
    definition: Callable[Arguments, Exchanges[Value]],
) -> Callable[Arguments, Value]:
    """A definition as a function that returns when its exchanges are complete."""
    if not inspect.isgeneratorfunction(definition):
        copy: Callable[Arguments, Value] = _copy(definition)
        return described(copy, definition)

    def method(*arguments: Arguments.args, **named: Arguments.kwargs) -> Value:
        return carried_out(definition(*arguments, **named))

    return described(method, definition)


def awaited(
    definition: Callable[Arguments, Exchanges[Value]],
) -> Callable[Arguments, Coroutine[Any, Any, Value]]:
    """A definition as a coroutine function."""
    several = inspect.isgeneratorfunction(definition)

    async def method(*arguments: Arguments.args, **named: Arguments.kwargs) -> Value:
        given: Any = definition(*arguments, **named)
        result: Value = await (awaiting(given) if several else given)
        return result

    return described(method, definition)


def carried_out(exchanges: Exchanges[Value]) -> Value:
    """The result of a definition whose exchanges are values."""
    value = None
    try:
        while True:
            value = exchanges.send(value)
    except StopIteration as end:
        result: Value = end.value
        return result


async def awaiting(exchanges: Exchanges[Value]) -> Value:
    """The result of a definition whose exchanges are awaited."""
    try:
        exchange = next(exchanges)
        while True:
            try:
                value = await exchange
            except BaseException as error:
                exchange = exchanges.throw(error)
            else:
                exchange = exchanges.send(value)
    except StopIteration as end:
        result: Value = end.value
        return result


def described(
    function: Function, definition: Callable[..., object], returned: str | None = None
) -> Function:
    """The function with the name, arguments and docstring of its definition."""
    signature = inspect.signature(definition)
    if returned is None:
        returned = str(signature.return_annotation).removeprefix("Exchanges[").removesuffix("]")
    functools.update_wrapper(function, definition, updated=())
    function.__signature__ = signature.replace(return_annotation=returned)  # type: ignore[attr-defined]
    return function


def _copy(function: Any) -> Any:
    """A copy of the function, which gets another description."""
    copy = FunctionType(
        function.__code__,
        function.__globals__,
        function.__name__,
        function.__defaults__,
        function.__closure__,
    )
    copy.__kwdefaults__ = function.__kwdefaults__
    return copy


def _make(cls: type, api: Callable[[Callable[..., Exchanges[Any]]], object]) -> None:
    """Replaces each definition that a class inherits by the method of its API."""
    found: dict[str, Any] = {}
    for base in reversed(cls.__mro__):
        found.update(vars(base))
    for name, definition in found.items():
        if getattr(definition, "_both_apis", False):
            method: Any = api(definition)
            method.__module__, method.__qualname__ = cls.__module__, f"{cls.__qualname__}.{name}"
            setattr(cls, name, _Reading(method) if _reads(method) else method)


def _reads(method: Callable[..., object]) -> bool:
    """Whether a method has no arguments and returns a value."""
    signature = inspect.signature(method)
    return len(signature.parameters) == 1 and signature.return_annotation != "None"


class _Reading:
    """A method that reads. :class:`_Uncalled` finds calls without brackets."""

    def __init__(self, method: Callable[..., object]) -> None:
        self._method = method

    def __get__(self, owner: object, kind: type | None = None) -> object:
        return self._method if owner is None else _Uncalled(self._method, owner)


# Python compares a method with anything, and the result is "not equal". `while motor.status != "RUN":` would
# never end, and the motor would turn. So a method that reads raises where only its value makes sense.
class _Uncalled:
    __slots__ = ("__func__", "__self__")
    __hash__ = None  # type: ignore[assignment]

    def __init__(self, method: Callable[..., object], owner: object) -> None:
        self.__func__ = method
        self.__self__ = owner

    def __call__(self, *arguments: Any, **named: Any) -> Any:
        return self.__func__(self.__self__, *arguments, **named)

    @property
    def __doc__(self) -> str | None:  # type: ignore[override]
        return self.__func__.__doc__

    def __getattr__(self, name: str) -> Any:
        # `inspect` and `functools` read these.
        if name.startswith("__"):
            return getattr(self.__func__, name)
        method = self.__func__.__name__
        raise AttributeError(f"`{method}` is a method: write `{method}().{name}`")

    def __repr__(self) -> str:
        return f"<method {self.__func__.__qualname__} of {self.__self__!r}>"

    def _refuse(self, *_: object) -> Any:
        name = self.__func__.__name__
        raise TypeError(f"`{name}` is a method: write `{name}()` for what it reads")

    __eq__ = __ne__ = __lt__ = __le__ = __gt__ = __ge__ = __bool__ = __str__ = __format__ = _refuse
    __add__ = __radd__ = __sub__ = __rsub__ = __mul__ = __rmul__ = __truediv__ = __rtruediv__ = _refuse
    __float__ = __int__ = __index__ = __abs__ = __round__ = __neg__ = _refuse
    __len__ = __getitem__ = __contains__ = _refuse


# Python's own errors contain the name of the class.
_Uncalled.__name__ = _Uncalled.__qualname__ = "method"


def fields(value: Any, kind: type, read: str) -> dict[str, Any]:
    """The fields of a named tuple by name; raises for anything else. A motor's method `read` reads one."""
    if isinstance(value, kind):
        return dict(value._asdict())  # type: ignore[attr-defined]
    first = kind._fields[0]  # type: ignore[attr-defined]
    raise TypeError(
        f"give a `{kind.__name__}`, such as `motor.{read}()._replace({first}=...)`; {value!r} is none"
    )


def check_request(request: object, kind: type, example: str) -> None:
    """Raises for anything but a request; the error has an example of one."""
    if isinstance(request, kind):
        return
    name = getattr(request, "__name__", None)
    found = f"`{name}` is a function that was not called" if name else f"{request!r} is none"
    raise TypeError(f"give a request, such as `{example}`; {found}")
