"""Wrong config files: one line per problem, with the file, the line, the finding, the remedy."""

import pytest

from flocsim.ensembles.config.loader import load_config
from flocsim.ensembles.config.schema import SCENES
from flocsim.ensembles.config.toml_text import key_lines
from flocsim.errors import ConfigError
from flocsim.fields import list_words
from tests.helpers.small_study import VALID, load_text, problem_lines

KINDS = list_words(SCENES)

# One wrong entry laid into an otherwise valid file → what its line says.
WRONG = {
    'preset = "tang"': "preset must be 'tang2014', 'tang2014-literal', 'si' or 'clay', found",
    "seed = true": "seed must be an integer from 0 to 9223372036854775807, found True",
    "replicates = 2.7": "replicates must be an integer from 1 to 1000000000, found 2.7",
    "replicats = 3": "replicats: unknown key (did you mean 'replicates'?)",
    "scene = 3": "scene must be a table [scene], found 3",
    "forces = []": "forces must be tables [forces.NAME], found []",
    "[scene]\ndelta = [0.0, true]": "scene.delta[1] must be a finite number at least 0, found True",
    "[scene]\ndelta = [0.5, 0.5]": "scene.delta[1] must be another value than",
    "[scene]\ndelta = ['0.5 m']": "scene.delta[0] must be a finite number at least 0",
    "[scene]\ndelta = []": "scene.delta must be a list of different values, each a finite",
    "[scene]\ntypes = ['I', 'IV']": "scene.types[1] must be 'I', 'II' or 'III', found 'IV'",
    "[scene]\npairs = [[1e-6]]": "scene.pairs[0] must be a list of 2, each a finite number",
    "[scene]\npairs = [[1e-6, '3 kg']]": "scene.pairs[0][1] must be a length such as '16.41 um'",
    "[scene]\npairs = [[16.41, 2e-5]]": "scene.pairs[0][0] must be a finite number above 0 and at "
    "most 0.01 [m], found 16.41",
    "[scene]\ntypes = ['I']\npairs = [[1e-6, 2e-6]]": "scene.pairs: excludes types, which is given",
    "[scene]\nstart_gap = inf": "scene.start_gap must be a finite number above 0 and",
    "[scene]\nstart_gap = '2'": "found '2' (a number in quotes needs a unit)",
    "[scene]\nstart_gap = '2 umm'": "found '2 umm' (unknown unit 'umm')",
    "[scene]\nescape_gap = 'start gap'": "scene.escape_gap must be 'start_gap' or a length such as "
    "'16.41 um', found 'start gap' (did you mean 'start_gap'?)",
    "[scene]\nrest_time = '2 um'": "scene.rest_time must be 'auto' or a time such as '5 s', found",
    "[scene]\ntime_limit = 1979-05-27": "must be 'auto' or a finite",
    "[scene.delta]\nx = 1": "scene.delta must be a list of different values, each a",
    "[shapes]\nvertices = [1, 3.0]": "[1] must be an integer from 1 to 512, found 3.0",
    "[shapes]\nfile = 'x.h5'": "shapes.file: applies only with source = 'library': remove it",
    "[shapes]\nsource = 'library'": 'shapes.source = "library" needs file',
    "[shapes]\nsource = 'library'\nfile = '.'\npool = 1": "shapes.file: ",
    "[shapes]\nsource = 'library'\nfile = ''": "shapes.file must be a string that is not blank",
    "[shapes]\nfractal_dimension = 2": "at least 1.2 and at most 1.95, found 2",
    "[bodies]\ndensity = 1\nsurface_density = 1": "bodies.density: excludes surface_density",
    "[bodies]\ndepth = '5 um'": "bodies: needs surface_density or density, found neither",
    "[bodies]\ndensity = "
    + "9" * 400: "bodies.density must be a finite number above 0 [kg/m^3], found 9",
    "[fluid]\nbuoyancy = true": "fluid.buoyancy: true needs bodies.density",
    "[fluid]\nbuoyancy = true\n[bodies]\ndensity = 500": "bodies.density: 500 kg/m^3 does not sink",
    "[fluid]\nvelocity = [1.0]": "fluid.velocity must be a list of 2, each a finite number",
    "[fluid]\ngradient = [0, 0, nan, 0]": "fluid.gradient[2] must be",
    "[forces.van_der_waals]\nhamaker = '3 kg'": "forces.van_der_waals.hamaker must be an "
    "energy such as '1e-18 J', found '3 kg'",
    "[forces.van_der_waals]\ngap = 'surfac'": "'surface', found 'surfac' (did you mean 'surface'?)",
    "[forces.contact]\nk_nn = 3": "forces.contact.k_nn: unknown key (did you mean 'k_n'?); known:",
    "[forces.contact]\ndamping_n = 'critcal'": "must be 'critical' or a rate such as '1e6 1/s'",
    "[forces.contact]\nfriction = 'some'": "forces.contact.friction must be 'none' or a finite",
    "[forces]\ngravity = true": "forces.gravity must be a table [forces.gravity], found True",
    "[forces]\ngravty = false": "forces.gravty: unknown force (did you mean 'gravity'?)",
    "[forces.gravty]": "forces.gravty: unknown force (did you mean 'gravity'?); known: gravity, ",
    "[forces.gravity]\nclass = 'own:Yukawa'": "forces.gravity.class: unknown key; known: g",
    "[forces.mine]\nclass = 3": "forces.mine.class must be 'module:Class', found 3",
    "[forces.mine]\nclass = 'own'": "forces.mine.class must be 'module:Class', found 'own'",
    "[forces.mine]\nclass = 'no_such:A'": "forces.mine.class: there is no module 'no_such', "
    "neither no_such.py nor installed",
    "[scene]\nweight = 'area'": "scene.weight: applies only with pairs = 'measured': remove it",
    "[scene]\narea_fraction = 0.1": "scene.area_fraction: applies only with kind = 'swarm': remove",
    "[scene]\nsizes = [1e-6]": "scene.sizes: applies only with kind = 'kernel': remove it",
    "[scene]\nrelease = 3": "scene.release: applies only with meeting = 'brownian': remove it",
    "[scene]\nkind = 'swarn'": f"scene.kind must be {KINDS}, found 'swarn'",
    "[scene]\nmeeting = 'swarm'": "scene.meeting must be 'settling', 'shear', 'extension' or ",
    "[scene]\nmeeting = ['shear']": "scene.meeting must be 'settling', 'shear', 'extension' or ",
    "[scene]\nmeeting = 'shear'": "scene: needs rate, the rate of the flow, as in rate =",
    "[zone]\nroot = 'inner'\ncentre = 1e-5": "zone.centre: excludes root, which is given too",
    "[zone]\ndistance = -1e-9": "must be a finite number at least 0 [m], found -1e-09",
    "[integrator]\nmax_steps = 1e6": "integrator.max_steps must be an integer",
    "[integrator]\nname = 3": "integrator.name must be 'implicit', 'dormand_prince54', "
    "'overdamped', 'velocity_verlet' or 'backward_euler', found 3",
    "[output]\nfile = '''a\nb'''": r"output.file must be a string that is not blank, found 'a\nb'",
    "[output]\n'a\\nb \" c' = 3": "output.a",
}


@pytest.mark.parametrize(("entry", "message"), WRONG.items())
def test_one_wrong_entry_is_one_line_with_its_number(tmp_path, entry, message):
    preset = "" if entry.startswith("preset") else 'preset = "tang2014"\n'
    [line] = problem_lines(tmp_path, preset + entry + "\n")
    place, _, text = line.partition(": ")
    assert message in text
    assert place.startswith("study.toml:")
    assert 1 <= int(place.split(":")[1]) <= len(entry.split("\n")) + 1


def test_all_problems_at_once_in_the_order_of_the_file(tmp_path):
    text = VALID.replace("seed = 3", "seed = 3.0").replace("    0.5,", "    'x',")
    text = text.replace('"1e-20 J"', '"3 kg"').replace("friction = 0.3", "fricton = 0.3")
    lines = problem_lines(tmp_path, text)
    assert [line.split(" ")[0] for line in lines] == [
        f"study.toml:{1 + text[: text.index(found)].count(chr(10))}:"
        for found in ("seed", "delta", "contact", "hamaker")
    ]
    assert "scene.delta[1]" in lines[1]
    assert "(did you mean 'friction'?)" in lines[2]


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", ["bodies: needs surface_density", "forces: there are none: add"]),
        ("[bodies]\nsurface_density = 2\n", ["forces: there are none: add [forces.gravity]"]),
        ("[forces.drag]\n", ["bodies: needs surface_density"]),
        ('preset = "ti"\n', ["preset must be"]),
    ],
)
def test_what_is_missing_is_said(tmp_path, text, said):
    lines = problem_lines(tmp_path, text)
    assert len(lines) == len(said)
    assert all(part in line for part, line in zip(said, lines, strict=True))


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (b"seed = 1\nseed = 2\n", ":2: not valid TOML: Cannot overwrite a value"),
        (b"seed = \n", ":1: not valid TOML: Invalid value (at line 1, column 8)"),
        (b"\x89HDF\r\n\x1a\n", "could not be read as a TOML config file in UTF-8"),
        (b"a = " + b"1" * 5000, "not valid TOML"),
    ],
)
def test_a_file_that_is_no_config(tmp_path, content, said):
    path = tmp_path / "study.toml"
    path.write_bytes(content)
    with pytest.raises(ConfigError) as caught:
        load_config(path)
    assert said in str(caught.value)
    assert str(caught.value).startswith(str(path))
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("name", ["no.toml", ".", "no/no.toml", "a\0b", "x" * 5000])
def test_a_path_without_a_file(tmp_path, name):
    with pytest.raises(ConfigError) as caught:
        load_config(tmp_path / name)
    assert "\n" not in str(caught.value)


def test_windows_files_load(tmp_path):
    path = tmp_path / "windows.toml"
    path.write_bytes(b"\xef\xbb\xbf" + VALID.replace("\n", "\r\n").encode())
    assert load_config(path).scene == load_text(tmp_path, VALID).scene
    path.write_bytes(b'preset = "si"\r\n\r\nseed = 1.5\r\n')
    with pytest.raises(ConfigError, match=r"windows.toml:3: seed must be"):
        load_config(path)


def test_keys_that_stand_in_a_text_once_have_their_line():
    text = 'x = 1\n"c d" = """\ny = 3\n[t]\nu = 1\n"""\n\n'
    text += "[t . u] # [v]\nk = [\n[1],\n[2, 3],\n]\nn = 1\ny.z = 2\n[[w]]\nn=1\n"
    lines = {"x": 1, "c d": 2, "t.u": None, "t.u.k": 9, "t.u.y.z": 14, "t.u.n": None}
    found = key_lines(text)
    assert {place: found.get(place) for place in lines} == lines


def test_a_key_of_an_inline_table_has_the_line_of_the_table(tmp_path):
    text = 'preset = "si"\nfluid = {viscosity = -1}\nshapes.pool = 0\nscene.types = ["IV"]\n'
    places = [line.split(": ")[0] for line in problem_lines(tmp_path, text)]
    assert places == ["study.toml:2", "study.toml:3", "study.toml:4"]


@pytest.mark.parametrize("key", ["presett", "preet", "Preset"])
def test_a_misspelt_preset_is_all_that_is_told(tmp_path, key):
    [line] = problem_lines(tmp_path, f'{key} = "si"\nseed = 1\n[shapes]\nvertices = [1]\n')
    assert line.startswith(f"study.toml:1: {key}: unknown key (did you mean 'preset'?)")


def test_a_contact_has_its_stiffness_once(tmp_path):
    text = 'preset = "si"\n[forces.contact]\nyoung = "1 MPa"\nk_n = 20\n'
    [line] = problem_lines(tmp_path, text)
    assert line.startswith("study.toml:4: forces.contact.k_n: excludes young, which is given too")
    text = 'preset = "si"\n[forces.contact]\nyoung = "1 MPa"\npoisson = 0.28\nrestitution = 0.5\n'
    contact = next(each for each in load_text(tmp_path, text).forces if hasattr(each, "young"))
    assert (contact.young, contact.k_n, contact.k_t, contact.damping_n) == (1e6, None, None, None)
