"""The command line's parser: what is misspelt is told with what may be meant."""

import argparse
import re
import shlex
import sys
from collections.abc import Sequence
from typing import Any, NoReturn

from flocsim.errors import suggestion

CHOICE = re.compile(r"invalid choice: '(.*?)' \(choose from (.*)\)", re.DOTALL)


class Parser(argparse.ArgumentParser):
    """An ArgumentParser, also of subcommands, whose errors say what may be meant."""

    words: Sequence[str] = ()

    def parse_known_args(self, args: Any = None, namespace: Any = None) -> Any:
        """Parse as argparse does, but refuse unknown words here, where the options are known."""
        self.words = list(sys.argv[1:] if args is None else args)
        found, unknown = super().parse_known_args(self.words, namespace)
        if unknown:
            hint = next(filter(None, map(self.misplaced, unknown)), "")
            self.error(f"unrecognized arguments: {' '.join(unknown)}{hint}")
        return found, unknown

    def misplaced(self, word: str) -> str:
        """How to write a word behind an option's value, which had to be a part of that; or ""."""
        place = self.words.index(word) if word in self.words else 0
        option = self.words[place - 2] if place >= 2 else ""
        takes_words = getattr(self._option_string_actions.get(option), "type", str) is None
        if word.startswith("-") or not takes_words:
            return ""
        value = self.words[place - 1]
        whole = f"{value},{word}" if word[:1].isdigit() else shlex.quote(f"{value} {word}")
        return f" (write {option} {whole})"

    def error(self, message: str) -> NoReturn:
        """End with what is wrong, and the word that is nearest to a misspelt one."""
        if choice := CHOICE.search(message):
            message += suggestion(choice[1], re.findall(r"[\w-]+", choice[2]))
        known = self._option_string_actions
        for name in (word.partition("=")[0] for word in self.words):
            if name.startswith("--") and not any(each.startswith(name) for each in known):
                message += suggestion(name, known)
        super().error(message)
