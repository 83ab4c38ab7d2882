"""What a site says of a sink."""

from dataclasses import dataclass

KINDS = ("detection", "diagnosis", "accepted", "rejected")  # of records, in the order in which they come


@dataclass(frozen=True, slots=True, kw_only=True)
class SinkOptions:
    """Where a sink tells what, and how it logs in.

    name: what the site calls it. to: its address. where: start of a message about it, with file and line. kinds: of
    records. user, password_file, authority, certificate, key: names and files of the log-in. token_file: what a program
    shows that asks, or is told; secret_file: what messages are signed with. give_up: s without success after which a
    record that cannot be told is passed over; None: never.
    """

    name: str
    to: str
    where: str = ""
    kinds: tuple[str, ...] = KINDS
    user: str = ""
    password_file: str = ""
    authority: str = ""
    certificate: str = ""
    key: str = ""
    token_file: str = ""
    secret_file: str = ""
    give_up: float | None = None
