"""A hook of mkdocs: what is fenced as ```math becomes MathML, which browsers draw by themselves.

GitHub draws the same fences; so the pages have one text for both, and the site loads nothing.
"""

from latex2mathml.converter import convert


def on_config(config):
    """Teach the fences of code a new kind."""
    known = config.mdx_configs.setdefault("pymdownx.superfences", {})
    known.setdefault("custom_fences", []).append(
        {"name": "math", "class": "math", "format": formula}
    )
    return config


def formula(source, language, css_class, options, md, **more):
    """The MathML of LaTeX, which scrolls by itself where a screen is narrow."""
    mathml = convert(source, display="block")
    return f'<div class="{css_class}" style="overflow: auto hidden">{mathml}</div>'
