"""Functions to be written in another language, and C read as Python."""

from __future__ import annotations


def _curve(p, code, x):
    total = 0.0
    for i in range(p.size):
        if code[i] == 0:
            total += p[i] * x
        elif x > 0.5:
            total += p[i]
    return total


def _early(x, limit):
    if x > limit:
        return limit, 1.0
    if x < -limit:
        return -limit, -1.0
    return x, 0.0


def _python(work, result, **values):
    """Run C code with the few statements that it has, as Python."""
    lines, _ = work.finish(result)
    text = "\n".join(lines).replace(";", "").replace("{", ":").replace("} else :", "else:")
    text = "\n".join(line for line in text.splitlines() if line.strip() != "}")
    names = dict(values)
    exec(text, {"fmin": min, "fmax": max}, names)
    return eval(work.text(result), {}, names)


def _counted(z, x):
    old = z[0]
    z[0] = old + x
    return old + z[0]
