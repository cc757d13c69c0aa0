"""The overlays of `flocsim fit`: where they go, and what they are drawn over."""

from pathlib import Path

from flocsim.commands.fitting.pictures import distinct, report, some_of, titles_of
from flocsim.errors import ImageError, UsageError
from flocsim.io.images.reading import SUFFIXES, read_grey
from flocsim.io.plots.shapes import draw_overlay, single_fit
from flocsim.io.plots.style import save
from flocsim.io.shapes.fit_report import plural


def pictures_beneath(name, paths, drawn):
    """{path of a mask: its picture in the folder of that name, None for none}.

    ``drawn``: whether overlays of masks are drawn at all. UsageError where it cannot be used.
    """
    if name is None:
        return {}
    if not drawn:
        raise UsageError("--pictures is for overlays of masks: give --masks and --overlay too")
    folder = Path(name)
    if not folder.is_dir():
        raise UsageError(f"--pictures takes a folder, found {name!r}")
    named: dict[str, list[Path]] = {}
    for path in sorted(folder.iterdir()):
        if path.suffix.lower() in SUFFIXES:
            named.setdefault(path.stem, []).append(path)
    found = {path: named[path.stem] for path in paths if path.stem in named}
    for mask, several in found.items():
        if len(several) > 1:
            raise UsageError(
                f"--pictures {name} has {several[0].name} and {several[1].name}, so the picture of "
                f"{mask.name} is ambiguous; move one of them away"
            )
    missing = [path.name for path in paths if path not in found]
    if missing:
        report(
            f"warning: --pictures {name} has no picture of {some_of(missing)}; drawn over the mask"
        )
    return {mask: several[0] for mask, several in found.items()}


def grey_beneath(picture, beneath, options):
    """What the overlay of a picture is drawn over."""
    if not options.masks:
        return read_grey(picture.path, picture.plane)
    mask = picture.found.foreground
    if picture.path not in beneath:
        return mask
    grey = read_grey(beneath[picture.path])
    if grey.shape == mask.shape:
        return grey
    sizes = [f"{width} × {height}" for height, width in (grey.shape, mask.shape)]
    report(
        f"warning: {beneath[picture.path]} has {sizes[0]} pixels and its mask {sizes[1]}; drawn "
        "over the mask"
    )
    return mask


def overlay_paths(overlay, names, several):
    """A path for the overlay of each of the pictures that have these (name, path of the file)."""
    if not several:
        return [overlay] * len(names)
    stems = [stem_of(name, [file.suffix.lower()]) for name, file in names]
    made = distinct((f"{overlay.stem}-{stem}" for stem in stems), overlay.suffix)
    return [overlay.with_name(name) for name in made]


def stem_of(name, suffixes):
    """The name of a picture in names of files, without one of these endings."""
    plain = Path(name.replace(":", "-").replace("/", "-"))
    return plain.stem if plain.suffix.lower() in suffixes else plain.name


def expected_overlays(overlay, paths):
    """The overlays that will be drawn, as far as it can be known before files are read."""
    names = list(zip(titles_of(paths), paths, strict=True))
    return overlay_paths(Path(overlay), names, len(paths) > 1) or [Path(overlay)]


def draw_fits(folder, pictures, options, rule):
    """Write a picture of every fit at the largest N and the smallest spheroradius."""
    for picture in pictures:
        for region in picture.regions:
            fit = finest(picture, region, options)
            figure = single_fit(region.mask, fit, f"{picture.name}#{region.label}")
            save(figure, Path(folder, f"{stem_of(picture.name, ())}-{region.label}.png"), rule)


def finest(picture, region, options):
    """The fit of a region at the largest N and the smallest spheroradius."""
    return picture.fits[region.label][0][options.radii[0]][options.vertices[-1]]


def draw(overlay, pictures, options, rule, several, beneath):
    """Write each picture with the outlines at the largest N and the smallest spheroradius.

    Returns what could not be drawn because its picture cannot be read any more.
    """
    most, radius = options.vertices[-1], options.radii[0]
    names = [(each.name, each.path) for each in pictures]
    paths, lost = overlay_paths(overlay, names, several or len(pictures) > 1), []
    for picture, path in zip(pictures, paths, strict=True):
        flocs = [(region, finest(picture, region, options)) for region in picture.regions]
        title = f"{picture.name}: {plural(len(flocs), 'floc')}, N = {most}, r = {radius:g} px"
        try:
            grey = grey_beneath(picture, beneath, options)
        except (ImageError, MemoryError) as error:
            report(str(error) or f"{picture.name}: not enough memory to draw its overlay")
            lost.append(str(path))
            continue
        figure = draw_overlay(grey, flocs, title, picture.found.rejected)
        save(figure, path, rule)
    return lost
