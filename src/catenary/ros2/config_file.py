"""Reading of the bridge's configuration, with errors that name the file, the line and the key."""

from __future__ import annotations

import re
import tomllib
from difflib import get_close_matches
from pathlib import Path
from typing import Any, get_args, get_type_hints

import msgspec

from catenary.errors import ConfigurationError
from catenary.ros2.config import PROFILES, Config, Table
from catenary.toml_lines import KeyPath, key_lines, line_of

_PLACE = re.compile(r"(?P<what>.*?)(?: - at `\$(?P<path>.*)`)?", re.DOTALL)
_STEP = re.compile(r"\.([^.\[]+)|\[(\d+)\]|\[(\.\.\.)\]")
_UNKNOWN = re.compile(r"Object contains unknown field `(.*)`", re.DOTALL)


def read_config(path: str | Path) -> Config:
    """Read the configuration of a bridge from a TOML file.

    Raises:
        ConfigurationError: The file cannot be read, or a key or value is not valid.
    """
    where = Path(path)
    try:
        text = where.read_bytes().decode("utf-8-sig")
        content = tomllib.loads(text)
    except OSError as error:
        raise ConfigurationError(f"{where}: {error.strerror or error}") from error
    except (UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
        raise ConfigurationError(f"{where}: not TOML: {error}") from error
    return make_config(content, where, text)


def make_config(
    content: dict[str, Any], path: Path = Path("configuration"), text: str = ""
) -> Config:
    """Convert the content of a file.

    Args:
        content: tables of the file.
        path: path of the file, for errors and relative paths in it.
        text: text of the file, for the line numbers of errors.

    Raises:
        ConfigurationError: A key or value is not valid.
    """
    profile = content.get("profile", "")
    defaults = PROFILES.get(profile, {}) if isinstance(profile, str) else {}
    whole = merged(defaults, content)
    try:
        config = msgspec.convert(whole, Config)
    except msgspec.ValidationError as error:
        raise _located(str(error), path, text, whole) from None
    return _with_model(config, path.parent)


def merged(defaults: dict[str, Any], content: dict[str, Any]) -> dict[str, Any]:
    """Return the content, with missing keys from the defaults. Lists are joined."""
    result = dict(defaults)
    for key, value in content.items():
        before = defaults.get(key)
        if isinstance(before, dict) and isinstance(value, dict):
            result[key] = merged(before, value)
        elif isinstance(before, list) and isinstance(value, list):
            result[key] = [*value, *before]  # indices in errors are those of the file
        else:
            result[key] = value
    return result


def _with_model(config: Config, folder: Path) -> Config:
    """Return the configuration with the path of the model relative to the file's folder."""
    pose = config.commands.pose
    if pose is None:
        return config
    pose = msgspec.structs.replace(pose, model=str(folder / pose.model))
    commands = msgspec.structs.replace(config.commands, pose=pose)
    return msgspec.structs.replace(config, commands=commands)


def _located(message: str, path: Path, text: str, content: Any) -> ConfigurationError:
    found = _PLACE.fullmatch(message)
    assert found is not None  # the pattern matches any text
    keys = tuple(
        int(number) if number else name or key
        for name, number, key in _STEP.findall(found["path"] or "")
    )
    what, hint = found["what"], ""
    unknown = _UNKNOWN.fullmatch(what)
    if unknown is not None:
        what, hint = f'unknown key "{unknown[1]}"', _known_keys(keys, unknown[1])
        keys = (*keys, unknown[1])
    elif "matching regex" in what:
        what = f"{_value_at(content, keys)!r} is not a valid name"
        hint = "use letters, digits and '_', in a topic or namespace separated by '/'"
    name = _dotted(keys)
    line = f":{line_of(key_lines(text), keys)}" if text else ""
    where = f"{path}{line}: {name}: " if name else f"{path}{line}: "
    return ConfigurationError(f"{where}{what[0].lower()}{what[1:]}", hint=hint)


def _value_at(content: Any, keys: KeyPath) -> object:
    for key in keys:
        content = content[key]
    return content


def _dotted(keys: KeyPath) -> str:
    parts = (f"[{key}]" if isinstance(key, int) else f".{key}" for key in keys)
    return "".join(parts).removeprefix(".")


def _known_keys(keys: KeyPath, unknown: str) -> str:
    """Return a hint for an unknown key of the table at `keys`."""
    names = _table_at(keys).__struct_fields__
    near = get_close_matches(unknown, names, n=1)
    return f'did you mean "{near[0]}"?' if near else f"the keys are {', '.join(names)}"


def _table_at(keys: KeyPath) -> type[Table]:
    table: type[Table] = Config
    for key in keys:
        if isinstance(key, str):
            kind = get_type_hints(table)[key]
            kinds = (kind, *get_args(kind))
            table = next(k for k in kinds if isinstance(k, type) and issubclass(k, Table))
    return table
