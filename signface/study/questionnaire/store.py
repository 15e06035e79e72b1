"""Where answers are kept: SQLite beside the study, or any PostgreSQL, through SQLAlchemy.

- `open_store`: open or create the database of a study.
- `Store`: participants, what they were shown, what they answered; each change is one transaction, on disk when the
  method returns.

A participant is a pseudonym. The private link is kept as a digest alone: who reads the database cannot answer in a
participant's place. No address, no browser and no name is stored.
"""

from __future__ import annotations

import contextlib
import hashlib
import secrets
import threading
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any

from signface.errors import SignfaceError
from signface.extras import needed
from signface.study.questionnaire.database import make_engine, make_tables

if TYPE_CHECKING:
    from sqlalchemy import Engine

#: Letters of a pseudonym: none that looks like another.
_LETTERS = "ABCDEFGHJKMNPQRSTUVWXYZ23456789"


class Refused(Exception):
    """What was asked may not be done now: the reason is a word for the log, and the pages translate it."""

    def __init__(self, reason: str) -> None:
        self.reason = reason
        super().__init__(reason)


@dataclass(frozen=True)
class Participant:
    """One row of the table of participants.

    Parameters
    ----------
    id : int
        The participant's number, from which the order of the stimuli follows.
    pseudonym : str
    language : str
    closed : int
        How many blocks are final.
    finished : bool
    """

    id: int
    pseudonym: str
    language: str
    closed: int
    finished: bool


def digest(token: str) -> str:
    """What is stored of a private link."""
    return hashlib.sha256(token.encode()).hexdigest()


def open_store(url_or_file: str | PathLike[str]) -> Store:
    """Open a store, creating its tables where they are missing.

    Parameters
    ----------
    url_or_file : str or path
        `postgresql://user:password@host/database`, or the path of an SQLite file.

    Raises
    ------
    SignfaceError
        The extra `study` is not installed, the URL is not understood, or the database cannot be opened.
    """
    sqlalchemy = needed("sqlalchemy", "study")
    text = str(url_or_file)
    is_url = "://" in text
    if is_url and not text.startswith(("postgresql://", "postgres://", "postgresql+psycopg://", "sqlite://")):
        raise SignfaceError("is neither a postgresql:// URL nor a file", file=text.partition("://")[0] + "://...")
    if not is_url:
        Path(text).parent.mkdir(parents=True, exist_ok=True)
    if is_url and not text.startswith("sqlite"):
        needed("psycopg", "study")
        text = "postgresql+psycopg://" + text.partition("://")[2]
    where = "the database" if is_url else text
    try:
        url = sqlalchemy.make_url(text if is_url else f"sqlite:///{Path(text).resolve()}")
        engine = make_engine(sqlalchemy, url)
        store = Store(engine)
        store.create()
    except (sqlalchemy.exc.OperationalError, sqlalchemy.exc.DatabaseError) as error:
        cause = str(error.orig).strip().splitlines()[0] if error.orig else str(error)
        raise SignfaceError(f"cannot be opened: {cause}", file=where) from error
    except sqlalchemy.exc.ArgumentError as error:
        raise SignfaceError("is not a URL of a database", file="--database") from error
    return store


class Store:
    """The database of one study; safe to use from several threads and processes.

    Parameters
    ----------
    engine : sqlalchemy.Engine
    """

    def __init__(self, engine: Engine) -> None:
        import sqlalchemy

        self._sql = sqlalchemy
        self._engine = engine
        self._metadata, self._tables = make_tables(sqlalchemy)
        dialect = engine.dialect.name
        self._insert = getattr(sqlalchemy.dialects, dialect).insert  # both know ON CONFLICT
        self._writer: Any = threading.Lock() if dialect == "sqlite" else contextlib.nullcontext()
        self._lock_row = dialect != "sqlite"  # SQLite locks the whole file when a writing transaction begins

    def create(self) -> None:
        """Create the tables that are missing."""
        with self._writing() as connection:
            self._metadata.create_all(connection)

    def close(self) -> None:
        """Let go of every connection."""
        self._engine.dispose()

    @contextlib.contextmanager
    def _writing(self) -> Iterator[Any]:
        """A transaction that changes something. SQLite has one writer: our threads queue for it, others ask again."""
        with self._writer, self._engine.execution_options(writes=True).begin() as connection:
            yield connection

    # ---- settings

    def setting(self, key: str, default: str) -> str:
        """A value of the study; the first `default` that anyone gives is kept."""
        table = self._tables["settings"]
        with self._writing() as connection:
            connection.execute(self._insert(table).values(key=key, value=default).on_conflict_do_nothing())
            return connection.execute(self._sql.select(table.c.value).where(table.c.key == key)).scalar_one()

    # ---- participants

    def enrol(self, language: str) -> tuple[Participant, str]:
        """A new participant and the token of the private link, which is known to nobody else."""
        token = secrets.token_urlsafe(24)
        pseudonym = "P" + "".join(secrets.choice(_LETTERS) for _ in range(7))
        table = self._tables["participants"]
        with self._writing() as connection:
            row = connection.execute(
                table.insert()
                .values(
                    pseudonym=pseudonym, token=digest(token), language=language, closed=0, started_at=datetime.now(UTC)
                )
                .returning(table.c.id)
            )
            return Participant(row.scalar_one(), pseudonym, language, 0, False), token

    def find(self, token: str) -> Participant | None:
        """The participant of a private link; None where nobody has it."""
        table = self._tables["participants"]
        with self._engine.connect() as connection:
            row = connection.execute(self._sql.select(table).where(table.c.token == digest(token))).one_or_none()
        return None if row is None else _participant(row)

    def speak(self, participant: Participant, language: str) -> None:
        """Change a participant's language."""
        table = self._tables["participants"]
        with self._writing() as connection:
            connection.execute(table.update().where(table.c.id == participant.id).values(language=language))

    def erase(self, pseudonym: str) -> int:
        """Forget a participant and everything answered; the number of answers that were erased.

        Raises
        ------
        SignfaceError
            Nobody has this pseudonym.
        """
        participants, answers = self._tables["participants"], self._tables["answers"]
        with self._writing() as connection:
            row = connection.execute(
                self._sql.select(participants.c.id).where(participants.c.pseudonym == pseudonym)
            ).one_or_none()
            if row is None:
                raise SignfaceError(f"no participant {pseudonym}", hint="signface study export lists them")
            count = connection.execute(answers.delete().where(answers.c.participant == row.id)).rowcount
            shown = self._tables["shown"]
            connection.execute(shown.delete().where(shown.c.participant == row.id))
            connection.execute(participants.delete().where(participants.c.id == row.id))
        if self._engine.dialect.name == "sqlite":
            with self._engine.connect() as connection:  # nothing of it may remain in the log of changes
                connection.execution_options(isolation_level="AUTOCOMMIT").exec_driver_sql(
                    "PRAGMA wal_checkpoint(TRUNCATE)"
                )
        return count

    # ---- answering

    def show(self, participant: Participant, stimulus: str) -> None:
        """Note that a stimulus was shown, the first time that it is."""
        table = self._tables["shown"]
        with self._writing() as connection:
            connection.execute(
                self._insert(table)
                .values(participant=participant.id, stimulus=stimulus, shown_at=datetime.now(UTC))
                .on_conflict_do_nothing()
            )

    def was_shown(self, participant: Participant, stimulus: str) -> bool:
        """Whether a stimulus was shown to a participant."""
        with self._engine.connect() as connection:
            return self._was_shown(connection, participant, stimulus)

    def _was_shown(self, connection: Any, participant: Participant, stimulus: str) -> bool:
        table = self._tables["shown"]
        query = self._sql.select(table.c.stimulus)
        query = query.where(table.c.participant == participant.id, table.c.stimulus == stimulus)
        return connection.execute(query).one_or_none() is not None

    def answer(self, participant: Participant, block: int, stimulus: str, values: Mapping[str, str]) -> None:
        """Keep the answers of one page, in one transaction: all of them or none.

        An answer that is there already is replaced as long as its block is open, so that whatever is sent twice
        remains one answer a question.

        Raises
        ------
        Refused
            `not shown`: the stimulus was not shown to the participant. `final`: the block is closed. `unknown`: the
            participant was erased meanwhile.
        """
        answers = self._tables["answers"]
        with self._writing() as connection:
            row = self._locked(connection, participant)
            if row.finished_at is not None or row.closed > max(block, 0):
                raise Refused("final")
            if stimulus and not self._was_shown(connection, participant, stimulus):
                raise Refused("not shown")
            page = {"participant": participant.id, "stimulus": stimulus, "answered_at": datetime.now(UTC)}
            rows = [page | {"question": question, "value": value} for question, value in values.items()]
            if rows:
                statement = self._insert(answers)
                connection.execute(
                    statement.on_conflict_do_update(
                        index_elements=["participant", "stimulus", "question"],
                        set_={"value": statement.excluded.value, "answered_at": statement.excluded.answered_at},
                    ),
                    rows,
                )

    def close_block(self, participant: Participant, block: int, stimuli: Sequence[str], *, last: bool) -> None:
        """Make the answers of a block final.

        Raises
        ------
        Refused
            `final`: it is closed already, or an earlier one is not. `incomplete`: a stimulus has no answer yet.
            `unknown`: the participant was erased meanwhile.
        """
        participants, answers = self._tables["participants"], self._tables["answers"]
        with self._writing() as connection:
            row = self._locked(connection, participant)
            if row.closed != block or row.finished_at is not None:
                raise Refused("final")
            query = self._sql.select(answers.c.stimulus).where(answers.c.participant == participant.id).distinct()
            if not set(stimuli) <= set(connection.execute(query).scalars()):
                raise Refused("incomplete")
            values = {"closed": block + 1, **({"finished_at": datetime.now(UTC)} if last else {})}
            connection.execute(participants.update().where(participants.c.id == participant.id).values(values))

    def _locked(self, connection: Any, participant: Participant) -> Any:
        """A participant's row, which no other transaction changes before this one ends."""
        table = self._tables["participants"]
        query = self._sql.select(table).where(table.c.id == participant.id)
        row = connection.execute(query.with_for_update() if self._lock_row else query).one_or_none()
        if row is None:
            raise Refused("unknown")
        return row

    def answers_to(self, participant: Participant, stimulus: str) -> dict[str, str]:
        """What a participant answered about a stimulus so far, by question."""
        table = self._tables["answers"]
        with self._engine.connect() as connection:
            query = self._sql.select(table.c.question, table.c.value).where(
                table.c.participant == participant.id, table.c.stimulus == stimulus
            )
            return dict(connection.execute(query).tuples().all())

    def answered(self, participant: Participant) -> set[str]:
        """The stimuli that a participant has answered."""
        table = self._tables["answers"]
        with self._engine.connect() as connection:
            query = self._sql.select(table.c.stimulus).where(table.c.participant == participant.id).distinct()
            return set(connection.execute(query).scalars())

    # ---- reading everything

    def everything(self) -> tuple[list[Participant], list[tuple[int, str, str, str]]]:
        """Every participant, and every answer as (participant's id, stimulus, question, value), from one moment."""
        participants, answers = self._tables["participants"], self._tables["answers"]
        with self._engine.connect() as connection:
            if self._engine.dialect.name == "postgresql":
                connection = connection.execution_options(isolation_level="REPEATABLE READ")
            people = connection.execute(self._sql.select(participants).order_by(participants.c.id)).all()
            query = self._sql.select(
                answers.c.participant, answers.c.stimulus, answers.c.question, answers.c.value
            ).order_by(answers.c.participant, answers.c.answered_at, answers.c.stimulus, answers.c.question)
            rows = connection.execute(query).tuples().all()
        return [_participant(row) for row in people], [tuple(row) for row in rows]

    def progress(self, minutes: float = 5.0) -> dict[str, Any]:
        """How the study goes: participants, those who finished, answered stimuli, pages answered a minute lately."""
        participants, answers = self._tables["participants"], self._tables["answers"]
        count, distinct = self._sql.func.count, self._sql.distinct
        last = self._sql.func.max(answers.c.answered_at).label("at")
        query = self._sql.select(answers.c.participant, answers.c.stimulus, last).where(answers.c.stimulus != "")
        pages = query.group_by(answers.c.participant, answers.c.stimulus).subquery()
        since = datetime.now(UTC) - timedelta(minutes=minutes)
        with self._engine.connect() as connection:
            started = connection.execute(self._sql.select(count(participants.c.id))).scalar_one()
            finished = connection.execute(
                self._sql.select(count(distinct(participants.c.id))).where(participants.c.finished_at.is_not(None))
            ).scalar_one()
            total = connection.execute(self._sql.select(count()).select_from(pages)).scalar_one()
            lately = connection.execute(
                self._sql.select(count()).select_from(pages).where(pages.c.at >= since)
            ).scalar_one()
            each = self._sql.select(
                participants.c.pseudonym, participants.c.finished_at, count(pages.c.stimulus).label("pages")
            )
            people = connection.execute(
                each.outerjoin(pages, pages.c.participant == participants.c.id)
                .group_by(participants.c.id, participants.c.pseudonym, participants.c.finished_at)
                .order_by(participants.c.id)
            ).all()
        return {
            "started": started,
            "finished": finished,
            "answered": total,
            "a_minute": lately / minutes,
            "people": [(row.pseudonym, row.pages, row.finished_at is not None) for row in people],
        }


def _participant(row: Any) -> Participant:
    return Participant(row.id, row.pseudonym, row.language, row.closed, row.finished_at is not None)
