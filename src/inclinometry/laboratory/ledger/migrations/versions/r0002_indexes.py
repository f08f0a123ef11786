"""Indexes for a million records: events are found by all that is known of them, readings by their session alone.

With an index of its own for a column of few different values (attempt 1, "session"), SQLite reads every row that has
the value instead of the few of the session or subject asked for.
"""

from alembic import op

revision = "0002"
down_revision = "0001"


def upgrade() -> None:
    """Change indexes only: a program that knows the first revision still reads and writes the ledger."""
    op.drop_index("ix_reading_position", "reading")
    op.drop_index("ix_reading_attempt", "reading")
    op.drop_index("ix_event_action", "event")
    op.create_index("ix_event_all", "event", ["subject_kind", "subject", "action", "seq"])
