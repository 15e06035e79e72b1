"""The database under a study: its connections and its tables (SQLAlchemy)."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from sqlalchemy import Engine


def make_engine(sqlalchemy: Any, url: Any) -> Engine:
    """Connections to a database; those to SQLite wait for one another and are on disk when they commit."""
    if url.get_backend_name() != "sqlite":
        return sqlalchemy.create_engine(url, pool_size=10, max_overflow=20, pool_pre_ping=True)
    engine = sqlalchemy.create_engine(url, connect_args={"timeout": 30, "check_same_thread": False}, pool_size=20)

    @sqlalchemy.event.listens_for(engine, "connect")
    def prepare(connection: Any, _record: object) -> None:
        connection.isolation_level = None  # the driver must not begin transactions of its own accord
        for pragma in ("journal_mode=WAL", "synchronous=FULL", "foreign_keys=ON", "secure_delete=ON"):
            connection.execute(f"PRAGMA {pragma}")

    @sqlalchemy.event.listens_for(engine, "begin")
    def begin(connection: Any) -> None:
        # A transaction that reads before it writes would fail when another wrote in between; this one waits instead.
        writes = connection.get_execution_options().get("writes", False)
        connection.exec_driver_sql("BEGIN IMMEDIATE" if writes else "BEGIN")

    return engine


def make_tables(sqlalchemy: Any) -> tuple[Any, dict[str, Any]]:
    """The tables of a study, and the metadata that creates them."""
    metadata = sqlalchemy.MetaData()
    Column, Text, Integer = sqlalchemy.Column, sqlalchemy.Text, sqlalchemy.Integer
    moment = sqlalchemy.DateTime(timezone=True)

    def owner() -> Any:
        return sqlalchemy.ForeignKey("participants.id", ondelete="CASCADE")

    tables = {
        "settings": sqlalchemy.Table(
            "settings", metadata, Column("key", Text, primary_key=True), Column("value", Text, nullable=False)
        ),
        "participants": sqlalchemy.Table(
            "participants",
            metadata,
            Column("id", Integer, primary_key=True),
            Column("pseudonym", Text, unique=True, nullable=False),
            Column("token", Text, unique=True, nullable=False),
            Column("language", Text, nullable=False),
            Column("closed", Integer, nullable=False, default=0),
            Column("started_at", moment, nullable=False),
            Column("finished_at", moment),
        ),
        "shown": sqlalchemy.Table(
            "shown",
            metadata,
            Column("participant", Integer, owner(), primary_key=True),
            Column("stimulus", Text, primary_key=True),
            Column("shown_at", moment, nullable=False),
        ),
        "answers": sqlalchemy.Table(
            "answers",
            metadata,
            Column("participant", Integer, owner(), primary_key=True),
            Column("stimulus", Text, primary_key=True),
            Column("question", Text, primary_key=True),
            Column("value", Text, nullable=False),
            Column("answered_at", moment, nullable=False, index=True),
        ),
    }
    return metadata, tables
