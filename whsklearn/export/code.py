"""C99 and Structured Text: a model that replays a drive, and a compensator."""

from __future__ import annotations

import re
from typing import Any

import jinja2

from whsklearn import __version__
from whsklearn.export.axis_code import WAVE, axis_code, compensated, torque_code
from whsklearn.export.chain_code import chain_code
from whsklearn.export.languages import C, Language, StructuredText
from whsklearn.export.model import Exported, Loss, left_out, losses_of, lost_parts, rigid
from whsklearn.logs.units import factor_of
from whsklearn.systems.chain import FAR

# No drive is larger, and products of four such numbers stay finite in the number format.
LARGEST_DRIVE = {"double": FAR, "float": 1e9}
_NOT_STEADY = "the compensator knows position and velocity only"


def render(template: str, **names: Any) -> str:
    """A template of the package with its names filled in."""
    env = jinja2.Environment(
        loader=jinja2.PackageLoader("whsklearn.export"), undefined=jinja2.StrictUndefined, keep_trailing_newline=True
    )
    return env.get_template(template).render(version=__version__, **names)


def identifier(text: str) -> str:
    """A name that C and Structured Text accept."""
    name = re.sub(r"\W", "_", text)
    return name if name[:1].isalpha() else f"model_{name}"


def code_losses(model: Exported, what: str) -> list[Loss]:
    """Parts of a model that its code or compensator cannot represent."""
    if model.axis is None:
        reason = "effects of a chain with a direct path are not exported"
        return losses_of(model.chain.effects, reason) if model.chain is not None and model.chain.direct else []
    out = lost_parts(model.axis, moving=True, limit=True)
    if what == "compensator":
        out += left_out(model.axis, _steady, _NOT_STEADY)
    return model.told(out)


def _steady(effect: Any) -> bool:
    if effect.place in ("sensor", "transmission", "drive"):
        return effect.name == "input_offset"
    return compensated(effect.code) if effect.code >= 0 else effect.port == "torque"


def c_files(model: Exported, name: str, what: str = "model", real: str = "double") -> tuple[dict[str, str], list[Loss]]:
    """Header and source by file name, and the losses.

    ``name``: prefix of all functions, and name of the files. ``what`` {"model", "compensator"}: the compensator is the
    function NAME_torque alone. ``real`` is {"double", "float"}.
    """
    lang = C(real)
    names = _shown(model, lang, name, what, real)
    names |= {"real": real, "states": None, "counters": [], "header": f"{name}.h", "guard": f"{name.upper()}_H"}
    names |= {"output": model.logged.capitalize(), "one": lang.number(1.0), "wave": WAVE}
    if (code := names["code"]) is not None:
        names["states"], names["counters"] = dict(code.states), ["samples"]
        if code.history > 1:
            names["states"]["history"] = code.history
            names["counters"] = ["samples", "newest"]
    elif names["chain"] is not None:
        names["states"] = names["chain"].states
    return {f"{name}.{end}": render(f"model.{end}.j2", **names) for end in ("h", "c")}, names["losses"]


def st_file(model: Exported, name: str, what: str = "model") -> tuple[str, list[Loss]]:
    """A function block NAME (or a function NAME_torque) in Structured Text, and the losses."""
    names = _shown(model, StructuredText(), name, what, drive="acting")
    return render("model.st.j2", **names), names["losses"]


def _shown(
    model: Exported, lang: Language, name: str, what: str, real: str = "double", drive: str = "drive"
) -> dict[str, Any]:
    """What the templates of both languages show; ``drive``: the variable with the drive of a chain."""
    names: dict[str, Any] = {"name": name, "lang": lang, "code": None, "chain": None, "torque": None}
    kind = "servo axis" if model.axis is not None else "Wiener-Hammerstein chain"
    title = f"{'Compensator' if what == 'compensator' else 'Free run'} of an identified {kind}."
    names |= {"title": title, "losses": code_losses(model, what), "largest": LARGEST_DRIVE[real]}
    if what == "compensator":
        factors = (*model.factors, factor_of(model.position_unit)[0])
        names["torque"] = torque_code(rigid(model.need_axis("A compensator")), lang, *factors)
    elif model.axis is not None:
        velocity, remember = model.logged == "velocity", isinstance(lang, C)
        names["code"] = axis_code(model.axis, lang, velocity=velocity, remember=remember, out=model.factors[1])
    elif model.chain is not None:
        names["chain"] = chain_code(model.chain, lang, drive=drive, out=model.factors[1])
    return names | _units(model, lang, what)


def _units(model: Exported, lang: Language, what: str) -> dict[str, str]:
    """The sentence on units, and the drive in SI as an expression of ``drive``."""
    into, out = (model.units.get(k, "") for k in ("input", "output"))
    drive = f"drive in {into}" if into else "drive not stated, Nm assumed"
    if what == "compensator":
        per = out if model.logged == "velocity" else f"{out}/s"
        far = model.position_unit
        motion = f"position in {far}, velocity in {per}" if out else "position and velocity not stated, rad assumed"
        return {"units": f"Units: {motion}; torque: {drive}.", "si_drive": "drive"}
    answer = f"{model.logged} in {out}" if out else f"{model.logged} not stated, SI assumed"
    by = model.factors[0]
    scaled = "drive" if by == 1.0 else f"{lang.number(by)} * drive"
    return {"units": f"Units: {drive}; {answer}; time in s.", "si_drive": scaled}
