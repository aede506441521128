"""Generated C that runs several gaits at once: every number is a vector with one entry per gait.

A step expression (CasADi SX, no branches) becomes straight-line C over vectors; the loop over the
steps is in C too. Entries never mix and nothing is contracted or reordered, so a gait gives the same
bits alone, in any company and on any processor.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from importlib import resources

import casadi as ca

# operations per C function: compilers take time that grows faster than a function's length (a step's tangent,
# 17,000 operations: 8.0 s at 2000, 4.5 s at 500, 2.7 s at 125, and runs as fast)
PART = 125
_ARGUMENTS = (
    "const loose *in0, const loose *in1, const loose *in2, const loose *in3, v *restrict w, "
    "v *restrict y0, v *restrict y1"
)
_INFIX = {ca.OP_ADD: "{0} + {1}", ca.OP_SUB: "{0} - {1}", ca.OP_MUL: "{0} * {1}", ca.OP_DIV: "{0} / {1}"}
_COMPARISONS = {ca.OP_LT: "<", ca.OP_LE: "<=", ca.OP_EQ: "==", ca.OP_NE: "!="}
_TEMPLATES = {
    **_INFIX,
    **{op: f"truth({{0}} {sign} {{1}})" for op, sign in _COMPARISONS.items()},
    ca.OP_ASSIGN: "{0}",
    ca.OP_NEG: "-{0}",
    ca.OP_SQ: "{0} * {0}",
    ca.OP_TWICE: "{0} + {0}",
    ca.OP_INV: "1 / {0}",
    ca.OP_NOT: "truth({0} == 0)",
    ca.OP_AND: "truth(({0} != 0) & ({1} != 0))",
    ca.OP_OR: "truth(({0} != 0) | ({1} != 0))",
    ca.OP_IF_ELSE_ZERO: "keep_if({0}, {1})",
    ca.OP_FABS: "absolute({0})",
    ca.OP_FMIN: "least({0}, {1})",
    ca.OP_FMAX: "most({0}, {1})",
    ca.OP_SIGN: "sign_of({0})",
    ca.OP_SQRT: "EACH(sqrt, {0})",
    ca.OP_EXP: "exp_of({0})",
    ca.OP_TANH: "tanh_of({0})",
    ca.OP_SINH: "sinh_of({0})",
    ca.OP_COSH: "cosh_of({0})",
    ca.OP_SIN: "sine({0}, 0)",
    ca.OP_COS: "sine({0}, 1)",
    ca.OP_LOG: "EACH(log, {0})",
    ca.OP_ATAN: "EACH(atan, {0})",
    ca.OP_ASIN: "EACH(asin, {0})",
    ca.OP_ACOS: "EACH(acos, {0})",
    ca.OP_TAN: "EACH(tan, {0})",
    ca.OP_FLOOR: "EACH(floor, {0})",
    ca.OP_POW: "EACH2(pow, {0}, {1})",
    ca.OP_CONSTPOW: "EACH2(pow, {0}, {1})",
    ca.OP_ATAN2: "EACH2(atan2, {0}, {1})",
}


def step_source(step: ca.Function, name: str, lanes: int) -> str:
    """Return C for ``name(n, keep, x0, valve, h, p, x, error)``: `n` steps of `step`, `lanes` gaits at once.

    Long expressions are cut into functions of their own (values that cross a cut go through memory):
    the compiler's effort grows faster than the length of a function.

    Parameters
    ----------
    step : Function
        ``(x, valve, h, p) -> (x_next, error)`` as one SX expression.
    lanes : int
        Gaits per call; all arrays have them as their last axis: x0 (nx, lanes), valve (n, N-1, lanes),
        h (n, lanes), p (np, lanes), x (n or 1, nx, lanes), error (n, lanes). With `keep` zero only the
        last state is stored.
    """
    header = resources.files("srs_opt.simulate").joinpath("lanes.h.in").read_text(encoding="utf-8")
    sizes = [step.numel_in(i) for i in range(4)]
    parts = [
        f"static __attribute__((noinline)) void part{i}({_ARGUMENTS})\n{{\n" + "\n".join(lines) + "\n}\n"
        for i, lines in enumerate(_parts(step))
    ]
    calls = " ".join(f"part{i}(in0, in1, in2, in3, w, y0, y1);" for i in range(len(parts)))
    return f"""#define LANES {lanes}
{header}
{"".join(parts)}
void {name}(long n, long keep, const double *x0, const double *valve, const double *h, const double *p,
            double *x, double *error)
{{
    const loose *in0 = (const loose *)x0, *in1 = (const loose *)valve, *in2 = (const loose *)h;
    const loose *in3 = (const loose *)p;
    loose *out0 = (loose *)x, *out1 = (loose *)error;
    v w[{step.sz_w() + 1}], y0[{step.numel_out(0)}], y1[1];
    for (long k = 0; k < n; k++) {{
        {calls}
        for (int i = 0; i < {step.numel_out(0)}; i++)
            out0[i] = y0[i];
        *out1++ = y1[0];
        in0 = out0;
        in1 += {sizes[1]};
        in2 += {sizes[2]};
        if (keep)
            out0 += {step.numel_out(0)};
    }}
}}
"""


@dataclass(frozen=True)
class _Instruction:
    """One operation; values are known by the number of the instruction that made them."""

    op: int
    of: tuple[int, ...]  # values, or (argument, entry) of an input
    to: tuple[int, ...]  # memory slot, or (result, entry) of an output
    constant: float


def _instructions(step: ca.Function) -> list[_Instruction]:
    slot: dict[int, int] = {}
    found = []
    for k in range(step.n_instructions()):
        op, of, to = step.instruction_id(k), step.instruction_input(k), step.instruction_output(k)
        values = of if op == ca.OP_INPUT else [slot[i] for i in of] if op != ca.OP_CONST else []
        constant = step.instruction_constant(k) if op == ca.OP_CONST else 0.0
        found.append(_Instruction(op, tuple(values), tuple(to), constant))
        if op != ca.OP_OUTPUT:
            slot[to[0]] = k
    return found


def _parts(step: ca.Function) -> list[list[str]]:
    """Return the C statements, every value assigned once, cut into functions that compile in linear time.

    Values that a later part needs wait in memory, in the slot that CasADi gave them.
    """
    code = _instructions(step)
    last_part: dict[int, int] = {}
    for k, instruction in enumerate(code):
        if instruction.op != ca.OP_INPUT:
            last_part.update(dict.fromkeys(instruction.of, k // PART))
    divisions = Counter(i.of[1] for i in code if i.op == ca.OP_DIV)
    shared = {divisor for divisor, count in divisions.items() if count > 1}
    parts = []
    for first in range(0, len(code), PART):
        part = range(first, min(first + PART, len(code)))
        needed = sorted({i for k in part if code[k].op != ca.OP_INPUT for i in code[k].of if i < first})
        lines = [f"const v t{i} = w[{code[i].to[0]}];" for i in needed]
        lines += _statements(code, part, shared)
        later = [k for k in part if code[k].op != ca.OP_OUTPUT and last_part.get(k, -1) > first // PART]
        parts.append([*lines, *(f"w[{code[k].to[0]}] = t{k};" for k in later)])
    return parts


def _statements(code: list[_Instruction], part: range, shared: set[int]) -> list[str]:
    """Return the part's C; by a divisor in `shared` is multiplied, wherever the cuts fall."""
    lines: list[str] = []
    inverted: set[int] = set()
    for k in part:
        op, of, to = code[k].op, code[k].of, code[k].to
        if op == ca.OP_OUTPUT:
            lines.append(f"y{to[0]}[{to[1]}] = t{of[0]};")
            continue
        if op == ca.OP_INPUT:
            value = f"in{of[0]}[{of[1]}]"
        elif op == ca.OP_CONST:
            # repr reads back as the same double
            value = f"all({code[k].constant!r})"
        elif op == ca.OP_DIV and of[1] in shared:  # one division for all of a part's
            if of[1] not in inverted:
                inverted.add(of[1])
                lines.append(f"const v r{of[1]} = 1 / t{of[1]};")
            value = f"t{of[0]} * r{of[1]}"
        else:
            value = _TEMPLATES[op].format(*(f"t{i}" for i in of))
        lines.append(f"const v t{k} = {value};")
    return lines
