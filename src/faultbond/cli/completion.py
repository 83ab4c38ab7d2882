"""What a shell needs to complete verbs, options, choices and files, written from the parser of the command line.

The scripts stand alone: a shell that completes a word starts no Python.
"""

import argparse
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

PROGRAM = "faultbond"
FILES = ("MODEL", "MODEL2", "REC", "STATE", "FILE", "FILE.html", "DIR", "STORE")  # names of arguments that are files


@dataclass(frozen=True, slots=True, kw_only=True)
class Argument:
    """An argument of a verb. words: the spellings of an option, else empty. value: its name, None where it has none."""

    words: tuple[str, ...]
    value: str | None
    choices: tuple[str, ...]
    meaning: str
    many: bool

    @property
    def is_file(self) -> bool:
        """Whether its value is a file."""
        return self.value in FILES


@dataclass(frozen=True, slots=True, kw_only=True)
class Verb:
    """A verb with its arguments, as its help tells them."""

    name: str
    summary: str
    arguments: tuple[Argument, ...]

    @property
    def options(self) -> tuple[Argument, ...]:
        """Those with a name."""
        return tuple(item for item in self.arguments if item.words)

    @property
    def positions(self) -> tuple[Argument, ...]:
        """Those without, in order."""
        return tuple(item for item in self.arguments if not item.words)


def script(shell: str, parser: argparse.ArgumentParser) -> str:
    """Give what a shell has to read, so that it completes the arguments that a parser takes.

    Parameters
    ----------
    shell : `bash`, `zsh` or `fish`
    parser : that of the program, with its verbs
    """
    program = Verb(name="", summary="", arguments=tuple(_arguments(parser)))
    return "\n".join([*SHELLS[shell](program, verbs_of(parser)), ""])


def verbs_of(parser: argparse.ArgumentParser) -> list[Verb]:
    """Give the verbs of a parser, in the order of the help."""
    found = []
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            for told in action._choices_actions:
                verb = action.choices[told.dest]
                found.append(
                    Verb(name=told.dest, summary=_plain(told, verb), arguments=tuple(_arguments(verb))),
                )
    return found


def _arguments(parser: argparse.ArgumentParser) -> Iterator[Argument]:
    """Give what the help of a parser shows, verbs left out."""
    for action in parser._actions:
        if action.help is argparse.SUPPRESS or isinstance(action, argparse._SubParsersAction):
            continue
        yield Argument(
            words=tuple(action.option_strings),
            value=None if action.nargs == 0 else str(action.metavar or action.dest.upper()),
            choices=tuple(map(str, action.choices or ())),
            meaning=_plain(action, parser),
            many=action.nargs in ("*", "+"),
        )


def _plain(action: argparse.Action, parser: argparse.ArgumentParser) -> str:
    """Give the help of an argument with its default filled in, and without quotation marks, which shells would read."""
    text = (action.help or "") % {**vars(action), "prog": parser.prog}
    return text.replace("'", "").replace('"', "").replace("`", "").replace("\\", "").replace("$", "")


def _bash(program: Verb, verbs: list[Verb]) -> Iterator[str]:
    """Write a function that looks at the verb, the word before, and the word."""
    after: dict[str, list[str]] = {}  # what is to be done after an option, and after which ones
    at: dict[str, list[str]] = {}  # what is to be done for a word of a verb
    for verb in verbs:
        for item in (item for item in verb.options if item.value is not None):
            does = _words_of_bash(item.choices) if item.choices else "_faultbond_files" if item.is_file else ":"
            after.setdefault(does, []).extend(f'"{verb.name} {word}"' for word in item.words)
        at.setdefault(_words_of_bash(_spellings(verb)), []).append(f'"{verb.name} -"*')
    for verb in verbs:
        if verb.positions:
            choices = [choice for item in verb.positions for choice in item.choices]
            at.setdefault(_words_of_bash(choices) if choices else "_faultbond_files", []).append(f'"{verb.name} "*')
    yield f"# Completion of {PROGRAM} for bash."
    yield "_faultbond() {"
    yield '    local word="${COMP_WORDS[COMP_CWORD]}" before="${COMP_WORDS[COMP_CWORD-1]}" verb="" i'
    yield "    local IFS=$' \\t\\n'"
    yield "    COMPREPLY=()"
    yield "    for ((i = 1; i < COMP_CWORD; i++)); do"
    yield '        case "${COMP_WORDS[i]}" in -*) ;; *) verb="${COMP_WORDS[i]}"; break ;; esac'
    yield "    done"
    yield '    case "$verb $before" in'
    for does, places in after.items():
        yield f"        {' | '.join(places)}) {does}; return ;;"
    yield "    esac"
    yield '    case "$verb $word" in'
    yield f'        " -"*) {_words_of_bash(_spellings(program))} ;;'
    yield f'        " "*) {_words_of_bash([verb.name for verb in verbs])} ;;'
    for does, places in at.items():
        yield f"        {' | '.join(places)}) {does} ;;"
    yield "    esac"
    yield "}"
    yield "_faultbond_files() {"
    yield "    local IFS=$'\\n'"
    yield "    compopt -o filenames 2>/dev/null"
    yield '    COMPREPLY=($(compgen -f -- "$word"))'
    yield "}"
    yield f"complete -F _faultbond {PROGRAM}"


def _words_of_bash(words: Sequence[str]) -> str:
    """Write what completes one of some words."""
    return f'COMPREPLY=($(compgen -W "{" ".join(words)}" -- "$word"))'


def _spellings(verb: Verb) -> list[str]:
    return [word for item in verb.options for word in item.words]


def _zsh(program: Verb, verbs: list[Verb]) -> Iterator[str]:
    """Write a function that hands the arguments of the verb to `_arguments`."""
    yield f"#compdef {PROGRAM}"
    yield f"# Completion of {PROGRAM} for zsh."
    yield "_faultbond() {"
    yield "    local -a verbs"
    yield "    verbs=("
    for verb in verbs:
        yield f"        '{verb.name}:{_colons(verb.summary)}'"
    yield "    )"
    yield "    if (( CURRENT == 2 )); then"
    yield "        _describe -t verbs verb verbs"
    yield f"        _arguments {' '.join(_of_zsh(program))}"
    yield "        return"
    yield "    fi"
    yield "    local verb=$words[2]"
    yield "    shift words"
    yield "    (( CURRENT-- ))"
    yield "    case $verb in"
    for verb in verbs:
        yield f"        {verb.name})"
        yield "            _arguments \\"
        yield " \\\n".join(f"                {item}" for item in _of_zsh(verb))
        yield "            ;;"
    yield "    esac"
    yield "}"
    yield 'if [[ "$funcstack[1]" == _faultbond ]]; then _faultbond "$@"; else compdef _faultbond faultbond; fi'


def _of_zsh(verb: Verb) -> Iterator[str]:
    """Write the arguments of a verb as `_arguments` reads them."""
    for item in verb.options:
        meaning = _colons(item.meaning).replace("[", "\\[").replace("]", "\\]")
        for word in item.words:
            yield f"'*{word}[{meaning}]{_value_of_zsh(item)}'"
    for place, item in enumerate(verb.positions, start=1):
        yield f"'{'*' if item.many else place}{_value_of_zsh(item)}'"


def _value_of_zsh(item: Argument) -> str:
    if item.value is None:
        return ""
    if item.choices:
        return f":{item.value}:({' '.join(item.choices)})"
    return f":{item.value}:{'_files' if item.is_file else ' '}"


def _colons(text: str) -> str:
    return text.replace(":", "\\:")


def _fish(program: Verb, verbs: list[Verb]) -> Iterator[str]:
    """Write a line for each thing that may be completed."""
    yield f"# Completion of {PROGRAM} for fish."
    yield f"complete -c {PROGRAM} -f"
    for item in program.options:
        yield f"complete -c {PROGRAM} -n __fish_use_subcommand{_of_fish(item)}"
    for verb in verbs:
        yield f"complete -c {PROGRAM} -n __fish_use_subcommand -a {verb.name} -d '{verb.summary}'"
    for verb in verbs:
        seen = f"complete -c {PROGRAM} -n '__fish_seen_subcommand_from {verb.name}'"
        yield from (f"{seen}{_of_fish(item)}" for item in verb.options)
        choices = [choice for item in verb.positions for choice in item.choices]
        if choices:
            yield f"{seen} -a '{' '.join(choices)}'"
        elif verb.positions:
            yield f"{seen} -F"


def _of_fish(item: Argument) -> str:
    """Write an option as `complete` of fish takes it."""
    words = "".join(f" -l {word[2:]}" if word.startswith("--") else f" -s {word[1:]}" for word in item.words)
    value = ""
    if item.choices:
        value = f" -x -a '{' '.join(item.choices)}'"
    elif item.value is not None:
        value = " -r -F" if item.is_file else " -x"
    return f"{words}{value} -d '{item.meaning}'"


SHELLS = {"bash": _bash, "zsh": _zsh, "fish": _fish}
