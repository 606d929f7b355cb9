from __future__ import annotations
def render(d): return f"<html><body>{d.sentence}</body></html>"
