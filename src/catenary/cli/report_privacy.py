"""Removal of the names of users and of this machine from texts that leave the machine."""

from __future__ import annotations

import os
import pwd
import re
import socket
from collections.abc import Mapping

HOME = re.compile(r"/home/[^/\s\"']+")
COMMON = frozenset({"root"})  # not the name of a person
SHORTEST = 2  # characters; a shorter name would also replace parts of sentences


class Redactor:
    """Replacement of private names. It owns one compiled pattern.

    Args:
        names: Replacement of each private name.
    """

    def __init__(self, names: Mapping[str, str]) -> None:
        self._names = {name: new for name, new in names.items() if len(name) >= SHORTEST}
        ordered = sorted(self._names, key=len, reverse=True)  # a name may contain another one
        words = "|".join(map(re.escape, ordered))
        self._pattern = re.compile(rf"(?<!\w)(?:{words})(?!\w)") if words else None

    def text(self, text: str) -> str:
        """Return the text without private names."""
        text = HOME.sub("/home/<user>", text)
        if self._pattern is None:
            return text
        return self._pattern.sub(lambda found: self._names[found[0]], text)

    def value(self, value: object) -> object:
        """Return a value for JSON without private names. The keys of objects stay."""
        if isinstance(value, str):
            return self.text(value)
        if isinstance(value, Mapping):
            return {key: self.value(each) for key, each in value.items()}
        if isinstance(value, list | tuple):
            return [self.value(each) for each in value]
        return value


def redactor_of_this_machine() -> Redactor:
    """Return a redactor for this host name, and for the users of this process."""
    names = dict.fromkeys(_users() - COMMON, "<user>")
    host = socket.gethostname()
    for name in (host, host.partition(".")[0]):
        if name != "localhost":
            names[name] = "<host>"
    home = os.path.expanduser("~")
    if home not in ("/", "/root"):
        names[home] = "<home>"
    return Redactor(names)


def _users() -> set[str]:
    found = {os.environ.get(name, "") for name in ("USER", "LOGNAME", "SUDO_USER")}
    for uid in (os.getuid(), os.geteuid()):
        try:
            found.add(pwd.getpwuid(uid).pw_name)
        except KeyError:  # a container without an entry for this user
            continue
    return found - {""}
