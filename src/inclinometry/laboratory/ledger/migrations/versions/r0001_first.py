"""The first ledger: chain, documents and ten kinds of record."""

import sqlalchemy as sa
from alembic import op

revision = "0001"
down_revision = None

_SEQ = sa.BigInteger().with_variant(sa.Integer(), "sqlite")
# written out, not taken from the program's tables: those will change, this revision must not
_KEYS: dict[str, dict[str, type[sa.Text | sa.Integer]]] = {
    "tool": {"serial": sa.Text},
    "rig": {"name": sa.Text},
    "site": {"name": sa.Text},
    "session": {"serial": sa.Text, "purpose": sa.Text},
    "reading": {"session": sa.Text, "position": sa.Integer, "attempt": sa.Integer},
    "calibration": {"serial": sa.Text, "session": sa.Text},
    "verification": {"serial": sa.Text, "calibration": sa.Text},
    "certificate": {"number": sa.Text, "serial": sa.Text},
    "user": {"name": sa.Text},
    "event": {"subject_kind": sa.Text, "subject": sa.Text, "action": sa.Text},
}
_UNIQUE = {"reading": ("session", "position", "attempt"), "certificate": ("number",)}


def upgrade() -> None:
    """Make the tables."""
    op.create_table(
        "chain",
        sa.Column("seq", _SEQ, primary_key=True, autoincrement=False),
        sa.Column("kind", sa.Text, nullable=False),
        sa.Column("record", sa.Text, nullable=False, unique=True),
        sa.Column("created", sa.Text, nullable=False),
        sa.Column("digest", sa.Text, nullable=False),
        sa.Column("link", sa.Text, nullable=False),
    )
    op.create_table(
        "document",
        sa.Column("digest", sa.Text, primary_key=True),
        sa.Column("media_type", sa.Text, nullable=False),
        sa.Column("data", sa.LargeBinary, nullable=False),
    )
    for name, keys in _KEYS.items():
        unique = [sa.UniqueConstraint(*_UNIQUE[name], name=f"uq_{name}")] if name in _UNIQUE else []
        op.create_table(
            name,
            sa.Column("seq", _SEQ, sa.ForeignKey("chain.seq"), primary_key=True, autoincrement=False),
            sa.Column("id", sa.Text, nullable=False, unique=True),
            sa.Column("created", sa.Text, nullable=False),
            sa.Column("author", sa.Text, nullable=False),
            sa.Column("version", sa.Integer, nullable=False),
            *(sa.Column(key, kind, nullable=False) for key, kind in keys.items()),
            sa.Column("body", sa.Text, nullable=False),
            *unique,
        )
        for key in keys:
            op.create_index(f"ix_{name}_{key}", name, [key, "seq"])
