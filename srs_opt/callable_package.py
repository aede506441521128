"""Subpackages named like their main function: ``python -m srs_opt.simulate`` and ``srs.simulate(...)``."""

from __future__ import annotations

import sys
from collections.abc import Callable
from importlib import import_module
from types import ModuleType
from typing import Any


class CallablePackage(ModuleType):
    """A package whose call is that of its main function; `inspect.signature` shows the function's."""

    @property
    def __wrapped__(self) -> Callable[..., Any]:
        module, name = self.__dict__["_main_function"]
        function: Callable[..., Any] = getattr(import_module(module), name)
        return function

    def __call__(self, *arguments: Any, **options: Any) -> Any:
        """Call the package's main function."""
        return self.__wrapped__(*arguments, **options)


def make_callable(package: str, module: str, function: str) -> None:
    """Let a call of `package` be one of ``module.function``, which is imported then.

    Once a submodule is imported, Python binds its package as an attribute of `srs_opt`: a function of the
    same name would be hidden by it.
    """
    found = sys.modules[package]
    found.__dict__["_main_function"] = (module, function)
    found.__class__ = CallablePackage
