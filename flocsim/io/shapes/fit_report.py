"""What `flocsim fit` tells a person: a line on every picture, tables."""

import csv
import io
import sys

CLASS_LIMIT = 5.0
"""r_eq [px] that parts the two size classes of the table (the paper's 5 µm at 1 µm a pixel)."""


def plural(count, noun):
    """ "1 floc", "2 flocs"."""
    return f"{count} {noun}" if count == 1 else f"{count} {noun}s"


def picture_line(name, found, fitted):
    """One line on a picture's Segmentation: flocs, rejected regions by reason, foreground."""
    parts = [plural(len(found.regions), f"{found.flocs} floc")]
    if fitted < len(found.regions):
        parts.append(f"the {fitted} largest fitted")
    reasons = [f"{count} {reason}" for reason, count in found.rejected_by_reason().items()]
    if reasons:
        parts.append(f"rejected {' and '.join(reasons)}")
    return f"{name}: {', '.join(parts)}; foreground {100 * found.foreground_share:.2f} %"


def warn_of_coarse(name, regions, radii):
    """A line on stderr for every spheroradius not below r_eq of some flocs (paper, section 3.2)."""
    for radius in radii:
        coarse = sum(region.equivalent_radius <= radius for region in regions)
        if coarse:
            print(
                f"flocsim: {name}: the spheroradius of {radius:g} px is not below r_eq of "
                f"{plural(coarse, 'floc')}, which it cannot follow; use a smaller --radius",
                file=sys.stderr,
            )


def format_errors(entries):
    """A table of the mean relative error [%] of ShapeEntries by N and size class, for each r."""
    radii = sorted({entry.spheroradius for entry in entries})
    return "\n".join(
        format_radius(radius, [e for e in entries if e.spheroradius == radius]) for radius in radii
    )


def format_radius(radius, entries):
    """The table for one spheroradius [px]."""
    classes = {
        f"r_eq <= {CLASS_LIMIT:g} px": [e for e in entries if e.equivalent_radius <= CLASS_LIMIT],
        f"r_eq > {CLASS_LIMIT:g} px": [e for e in entries if e.equivalent_radius > CLASS_LIMIT],
        "all": entries,
    }
    heads = [f"{name} ({len(members)})" for name, members in classes.items()]
    lines = [
        f"mean relative error [%] by vertices and size class (number of flocs), r = {radius:g} px",
        "  ".join([f"{'N':>10}", *(f"{head:>18}" for head in heads)]),
    ]
    for count in entries[0].fits:
        means = [mean_error(members, count) for members in classes.values()]
        label = "1 (circle)" if count == 1 else str(count)
        lines.append("  ".join([f"{label:>10}", *(f"{mean:>18}" for mean in means)]))
    return "\n".join(lines)


def mean_error(entries, count):
    """The mean relative error at N = `count`, "-" without flocs."""
    errors = [entry.fits[count].relative_error for entry in entries]
    return f"{sum(errors) / len(errors):.2f}" if errors else "-"


COLUMNS = (
    "picture", "floc", "left_out_because", "x_px", "y_px", "area_px", "r_eq_px", "r_eq_m", "blur_px"
)  # fmt: skip


def summary_text(pictures, fits, pixel_size):
    """The table of all regions as CSV: flocs with RE [%] for every r [px] and N, others with why.

    pictures: with name, found (Segmentation) and regions, the fitted ones of found.regions;
    fits: {r: {N: Fit}} of these regions in their order; pixel_size [m].
    """
    radii = list(fits[0]) if fits else []
    pairs = [(radius, count) for radius in radii for count in fits[0][radius]]
    text = io.StringIO()
    table = csv.writer(text, lineterminator="\n")
    table.writerow([*COLUMNS, *(f"re_percent_r{r:g}_N{n}" for r, n in pairs)])
    results = iter(fits)
    for picture in pictures:
        fitted = {region.label: next(results) for region in picture.regions}
        for region in picture.found.regions:
            why = "" if region.label in fitted else "not among the largest"
            row = [picture.name, region.label, why, *_facts(region, pixel_size)]
            errors = [f"{fitted[region.label][r][n].relative_error:.4f}" for r, n in pairs
                      if region.label in fitted]  # fmt: skip
            table.writerow([*row, *(errors or [""] * len(pairs))])
        for region in picture.found.rejected:
            row = [picture.name, "", region.reason, *_facts(region, pixel_size)]
            table.writerow([*row, *[""] * len(pairs)])
    return text.getvalue()


def _facts(region, pixel_size):
    x, y = region.centroid
    radius = region.equivalent_radius
    blur = "" if region.blur != region.blur else f"{region.blur:.2f}"
    return f"{x:.2f}", f"{y:.2f}", region.area, f"{radius:.3f}", f"{radius * pixel_size:.4g}", blur
