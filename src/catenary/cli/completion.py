"""`catenary completion bash|zsh`: print a completion script."""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Mapping
from string import Template

from catenary.cli.parsers import Commands, add_command

SHELLS = ("bash", "zsh")
FILE_METAVARS = ("FILE", "FOLDER", "DIR", "PATH", "OUT")
FILES = {"bash": "_shtab_compgen_files", "zsh": "_files"}
STATES = ("INIT", "PREOP", "SAFEOP", "OP", "BOOT")

# Words by metavar: a shell function prints or adds them.
FUNCTIONS: Mapping[str, str] = {
    "TARGET": "_catenary_targets",
    "NIC": "_catenary_interfaces",
    "NIC2": "_catenary_interfaces",
    "SHARE": "_catenary_shares",
    "STATE": "_catenary_states",
    "T": "_catenary_types",
}
# Bash expands words, also `$(...)`. So names from folders of other users must be plain.
LISTS = r"""
_catenary_plain() { case "$1" in *[!A-Za-z0-9._-]*) ;; *) echo "$1" ;; esac; }
_catenary_list_interfaces() {
    local each
    for each in /sys/class/net/*; do _catenary_plain "${each##*/}"; done
}
_catenary_list_shares() {
    local each
    while read -r each; do _catenary_plain "${each##*/share-}"; done < <(
        find /run/catenary "/dev/shm/catenary-$UID" -maxdepth 1 -name 'share-*' 2>/dev/null)
}
_catenary_list_targets() {
    _catenary_list_interfaces
    echo virtual; echo virtual-realtime
}
_catenary_list_states() { echo "$states"; }
_catenary_list_types() { echo "$types"; }
"""
BASH = r"""
_catenary_words() { compgen -W "$("$1" | tr '\n' ' ')" -- "$2"; }
_catenary_interfaces() { _catenary_words _catenary_list_interfaces "$1"; }
_catenary_shares() { _catenary_words _catenary_list_shares "$1"; }
_catenary_states() { _catenary_words _catenary_list_states "$1"; }
_catenary_types() { _catenary_words _catenary_list_types "$1"; }
_catenary_targets() { _catenary_words _catenary_list_targets "$1"; _shtab_compgen_files "$1"; }
"""
ZSH = r"""
_catenary_words() { local -a words; words=(${=$("$1")}); compadd -a words; }
_catenary_interfaces() { _catenary_words _catenary_list_interfaces; }
_catenary_shares() { _catenary_words _catenary_list_shares; }
_catenary_states() { _catenary_words _catenary_list_states; }
_catenary_types() { _catenary_words _catenary_list_types; }
_catenary_targets() { _catenary_words _catenary_list_targets; _files; }
"""


def add_parser(commands: Commands) -> None:
    parser = add_command(
        commands,
        "completion",
        help="print a completion script for bash or zsh",
        description="Prints a script that completes commands, options, network interfaces, names "
        "of shares and files. Needs catenary[completion] when it is printed, not when it is used. "
        "Print it again after an update.\n"
        "  bash: write it to ~/.local/share/bash-completion/completions/catenary\n"
        "  zsh: write it to a file _catenary in a folder of $fpath\n"
        "Create the folder first if it does not exist.",
        example="mkdir -p ~/.local/share/bash-completion/completions\n"
        "catenary completion bash > ~/.local/share/bash-completion/completions/catenary\n"
        "catenary completion zsh > ~/.zfunc/_catenary",
    )
    parser.add_argument("shell", metavar="SHELL", choices=SHELLS, help="bash or zsh")
    parser.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> int:
    print(script(arguments.shell, arguments.make_parser()))
    return 0


def script(shell: str, parser: argparse.ArgumentParser) -> str:
    """Return the completion script of all commands for a shell.

    Args:
        shell: "bash" or "zsh".
        parser: Parser of all commands, which is changed.

    Raises:
        ConfigurationError: The package shtab is not installed.
    """
    from catenary.monitor.extra import require

    library = require("shtab", "completion")
    for action in arguments_of(parser):
        functions = completion_of(action)
        if functions is not None:
            action.complete = functions  # type: ignore[attr-defined]
    preamble = {"bash": lists() + BASH, "zsh": lists() + ZSH}
    text: str = library.complete(parser, shell=shell, preamble=preamble)
    return text


def lists() -> str:
    """Return the shell functions that print words."""
    from catenary.types import ALL

    words = {"states": " ".join(STATES), "types": " ".join(each.name for each in ALL)}
    return Template(LISTS).safe_substitute(words)


def arguments_of(parser: argparse.ArgumentParser) -> Iterator[argparse.Action]:
    """Yield the arguments of all commands."""
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            for inner in action.choices.values():
                yield from arguments_of(inner)
        else:
            yield action


def completion_of(action: argparse.Action) -> Mapping[str, str] | None:
    """Return the functions that complete an argument, by shell; None without completion."""
    name = action.metavar if isinstance(action.metavar, str) else ""
    if action.nargs == 0 or action.choices is not None:
        return None
    if name in FUNCTIONS:
        return dict.fromkeys(SHELLS, FUNCTIONS[name])
    return FILES if name.startswith(FILE_METAVARS) and "=" not in name else None
