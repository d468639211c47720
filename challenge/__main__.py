"""Make a challenge, or score answers to one.

python -m challenge make DIR --n 100 --seed 1234567890
python -m challenge score DIR ANSWERS.json
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import NoReturn

from challenge.answers import read_answers
from challenge.composition import compose
from challenge.files import ChallengeError, key_path, read_key, write_challenge
from challenge.scoring import Score, score


class _Parser(argparse.ArgumentParser):
    """Tells a bad argument in one line, as everything else."""

    def error(self, message: str) -> NoReturn:
        self.exit(2, f"challenge: {message}\n")


def _parser() -> argparse.ArgumentParser:
    parser = _Parser(prog="python -m challenge", description=(__doc__ or "").splitlines()[0])
    commands = parser.add_subparsers(dest="command", required=True)
    make = commands.add_parser("make", help="write records without answers, and a key apart from them")
    make.add_argument("folder", metavar="DIR", type=Path, help="new folder for the records")
    make.add_argument("--n", type=int, default=100, help="number of cases (default: %(default)s)")
    make.add_argument("--seed", type=int, required=True, help="source of all chance, to be kept secret")
    make.add_argument("--key", type=Path, metavar="FILE", help="file for the key (default: DIR.key.json beside DIR)")
    make.add_argument(
        "--samples",
        type=int,
        nargs=2,
        default=(2000, 20_000),
        metavar=("LEAST", "MOST"),
        help="length of the training records (default: 2000 20000)",
    )
    judge = commands.add_parser("score", help="score answers")
    judge.add_argument("folder", metavar="DIR", type=Path, help="folder of the records")
    judge.add_argument("answers", metavar="ANSWERS", type=Path, help="JSON file of answers")
    judge.add_argument("--key", type=Path, metavar="FILE", help="file of the key (default: DIR.key.json beside DIR)")
    return parser


def _make(options: argparse.Namespace) -> None:
    least, most = options.samples
    if options.n < 1:
        raise ChallengeError(f"--n: {options.n}, allowed: 1 or more")
    if options.seed < 0:
        raise ChallengeError(f"--seed: {options.seed}, allowed: 0 or more")
    if not 200 <= least <= most <= 100_000:
        raise ChallengeError(f"--samples: {least} {most}, allowed: rising, from 200 to 100000")
    key = write_challenge(
        compose(options.n, options.seed, (least, most)),
        options.folder,
        options.key or key_path(options.folder),
        progress=lambda done: print(f"\r{done} of {options.n} cases", end="", file=sys.stderr, flush=True),
    )
    print(file=sys.stderr)
    print(f"records: {options.folder}; key, to be kept apart: {key}")


def _score(options: argparse.Namespace) -> None:
    truths = read_key(options.key or key_path(options.folder), options.folder)
    print(told(score(truths, read_answers(options.answers, truths))))


def told(scored: Score) -> str:
    """Return a score in lines."""

    def share(hits: int, many: int) -> str:
        return f"{hits}/{many} ({100.0 * hits / many:.1f} %)" if many else "no such case"

    lines = [
        f"cases answered               {share(scored.n_answered, scored.n_cases)}",
        f"detection                    {share(scored.n_detected, scored.n_hidden)}",
        f"false alarms                 {share(scored.n_false_alarms, scored.n_empty)}",
        f"probability of the true cause {100.0 * scored.true_probability:.1f} % on average",
        f"true cause ranked first      {share(scored.n_first, scored.n_hidden)}",
        "",
        "hidden                          cases  detected  true cause's probability",
    ]
    for name, part in scored.by_cause.items():
        lines.append(f"{name:<32}{part.n_hidden:>5}{part.n_detected:>10}{100.0 * part.true_probability:>12.1f} %")
    return "\n".join(lines)


def main(arguments: list[str] | None = None) -> int:
    """Run a command; 0 done, 2 bad input with one line that says what."""
    options = _parser().parse_args(arguments)
    try:
        (_make if options.command == "make" else _score)(options)
    except ChallengeError as error:
        print(f"challenge: {error}", file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
