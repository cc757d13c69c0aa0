"""What is misspelt on the command line is told with what may be meant, for every command."""

import pytest

from flocsim.__main__ import main


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ("ensamble study.toml", "(did you mean 'ensemble'?)"),
        ("fit a.png --pixelsize 1", "(did you mean '--pixel-size'?)"),
        ("fit a.png --verticies=4", "(did you mean '--vertices'?)"),
        ("fit --verticies 4", "(did you mean '--vertices'?)"),
        ("fit a.png --vertices 4 16", "unrecognized arguments: 16;"),
        ("init --kind measurd", "(did you mean 'measured'?)"),
        ("ensemble study.toml --replicats 4", "(did you mean '--replicates'?)"),
        ("ensemble study.toml --seed 1 2", "unrecognized arguments: 2;"),
        ("plot study.h5 --overwite", "(did you mean '--overwrite'?)"),
    ],
)
def test_a_misspelt_word_is_told_with_the_nearest(line, said, capsys):
    with pytest.raises(SystemExit) as ended:
        main(line.split())
    assert ended.value.code == 2
    [line] = capsys.readouterr().err.splitlines()
    assert said in line
