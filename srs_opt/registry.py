"""What is known by name of one kind of thing: built-in ones, and those of plugins and installed packages."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping
from importlib.metadata import entry_points
from types import MappingProxyType, ModuleType
from typing import Any, Generic, TypeVar

from srs_opt import plugins
from srs_opt.errors import InputError

T = TypeVar("T")
_OF_KIND: dict[str, Registry[Any]] = {}


class Registry(Generic[T]):
    """The things of one kind, by their attribute ``name``.

    Parameters
    ----------
    kind : str
        As messages call it; installed packages offer theirs as entry points of the group ``srs_opt.{kind}s``.
    built_in : callable
        Returns the library's own by name; asked once, when first needed.
    is_one : callable
        Whether an object is of the kind: what else a package's module holds is passed over.
    """

    def __init__(
        self,
        kind: str,
        built_in: Callable[[], Mapping[str, T]],
        is_one: Callable[[Any], bool],
    ) -> None:
        self.kind = kind
        self.own: dict[str, T] = {}
        self._built_in, self._is_one = built_in, is_one
        self._library: Mapping[str, T] | None = None
        self._asked_packages = False
        _OF_KIND[kind] = self

    @property
    def built_in(self) -> Mapping[str, T]:
        """The library's own, by name."""
        if self._library is None:
            self._library = MappingProxyType(dict(self._built_in()))
        return self._library

    def all(self) -> Mapping[str, T]:
        """Return everything that is known, own things last."""
        if not self._asked_packages:
            self._asked_packages = True
            for _, offered in plugins.entry_points(f"srs_opt.{self.kind}s"):
                found = vars(offered).values() if isinstance(offered, ModuleType) else offered
                for thing in found if isinstance(found, Iterable) else (found,):
                    if self._is_one(thing):
                        self.register(thing)
        return MappingProxyType({**self.built_in, **self.own})

    def register(self, thing: T) -> T:
        """Make a thing of one's own known, by its name.

        Raises
        ------
        InputError
            If it is none of this kind, or its name is taken or no plain word.
        """
        if not self._is_one(thing):
            raise InputError(f"{thing!r} is no {self.kind}")
        name = str(thing.name)  # type: ignore[attr-defined]
        if not re.fullmatch(r"[a-z][a-z0-9_]*", name):
            raise InputError(
                f"{self.kind} '{name}': expected a name of lower-case letters, digits and underscores"
            )
        if name in self.built_in:
            raise InputError(f"{self.kind} '{name}' exists already; choose another name")
        if self.own.setdefault(name, thing) != thing:
            raise InputError(f"{self.kind} '{name}' was registered before with another definition")
        return thing

    def named(self, name: str) -> T:
        """Return the thing with this name.

        Raises
        ------
        InputError
            If there is none; it lists those that there are.
        """
        known = self.all()
        if name not in known:
            raise InputError(
                f"{self.kind} must be one of {', '.join(known)}, found '{name}' "
                "(--plugin FILE.py adds your own)"
            )
        return known[name]


def own_names(kind: str) -> tuple[str, ...]:
    """Return the names that plugins and installed packages add to a kind, without loading the library's."""
    registered = _OF_KIND[kind].own if kind in _OF_KIND else ()
    return (*registered, *(point.name for point in entry_points(group=f"srs_opt.{kind}s")))
