"""CasADi's C, its long functions cut into short ones: compilers take time that grows faster than a length."""

from __future__ import annotations

import re

# statements per function: the Hessian of a collocation point, 29,000 of them, compiles in 13 s whole, in
# 3.5 s at 250 and at 500, in 3.1 s at 125; what crosses the cuts costs a tenth of the running time
PART = 250
_SIGNATURE = "const casadi_real** arg, casadi_real** res, casadi_int* iw, casadi_real* w, int mem"
_PARAMETERS = "const casadi_real** arg, casadi_real** res, casadi_real* s"
_FUNCTION = re.compile(
    rf"static int (\w+)\({re.escape(_SIGNATURE)}\) \{{\n"
    r"(?:  casadi_real a\d+[^;]*;\n)+(.*?)  return 0;\n\}\n",
    re.DOTALL,
)
_STATEMENT = re.compile(r"  (?:(a\d+)=|if \(res\[\d+\]!=0\) res)")  # an operation, or a result
_VALUE = re.compile(r"\ba\d+\b")


def in_parts(source: str) -> str:
    """Return generated C with every long function without branches or loops in parts.

    The operations and their order stay, so the results have the same bits.
    """
    return _FUNCTION.sub(lambda match: _cut(match[0], match[1], match[2].splitlines()), source)


def _cut(whole: str, name: str, body: list[str]) -> str:
    if len(body) < 2 * PART or not all(map(_STATEMENT.match, body)):
        return whole
    parts = [_Part(body[k : k + PART]) for k in range(0, len(body), PART)]
    functions: list[str] = []
    places: dict[str, int] = {}
    later: set[str] = set()  # values that are read after the part before they are made again
    for k, part in reversed(list(enumerate(parts))):
        kept = sorted(part.made & later)
        for value in (*part.taken, *kept):
            places.setdefault(value, len(places))
        lines = [f"  casadi_real {', '.join(sorted(part.made | part.taken))};"]
        lines += [f"  {value}=s[{places[value]}];" for value in sorted(part.taken)]
        lines += [*part.lines, *(f"  s[{places[value]}]={value};" for value in kept)]
        head = f"static __attribute__((noinline)) void {name}_{k}({_PARAMETERS}) {{"
        functions.append("\n".join([head, *lines, "}\n"]))
        later = later - part.made | part.taken
    calls = "".join(f"  {name}_{k}(arg, res, s);\n" for k in range(len(parts)))
    frame = f"  casadi_real s[{len(places)}];\n" if places else "  casadi_real* s = 0;\n"
    return (
        "".join(reversed(functions)) + f"static int {name}({_SIGNATURE}) {{\n{frame}{calls}  return 0;\n}}\n"
    )


class _Part:
    """Statements with the values that they make, and those that they take from before."""

    def __init__(self, lines: list[str]) -> None:
        self.lines = lines
        self.made: set[str] = set()
        self.taken: set[str] = set()
        for line in lines:
            made = _STATEMENT.match(line)
            assert made is not None
            self.taken.update(v for v in _VALUE.findall(line[made.end() :]) if v not in self.made)
            if made[1]:
                self.made.add(made[1])
