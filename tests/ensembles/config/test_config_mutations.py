"""Whatever is done to a valid config file, it loads or says what is wrong, and nothing else."""

from hypothesis import HealthCheck, given, settings

from flocsim.ensembles.config.loader import load_config
from flocsim.errors import ConfigError
from tests.helpers.config_mutations import GARBLED, MUTATED


def loads_or_says_why(path, text):
    path.write_bytes(text.encode("utf-8", "surrogatepass"))
    try:
        load_config(path)
    except ConfigError as error:
        lines = str(error).split("\n")
        assert all(line.startswith(str(path)) and line.isprintable() for line in lines)


@settings(
    max_examples=4 * settings().max_examples,
    suppress_health_check=[HealthCheck.function_scoped_fixture],
)
@given(MUTATED)
def test_a_mutated_config_loads_or_says_why(tmp_path, text):
    loads_or_says_why(tmp_path / "study.toml", text)


@settings(
    max_examples=3 * settings().max_examples,
    suppress_health_check=[HealthCheck.function_scoped_fixture],
)
@given(GARBLED)
def test_a_garbled_text_loads_or_says_why(tmp_path, text):
    loads_or_says_why(tmp_path / "study.toml", text)
