"""Signed heads: what the laboratory's key says of all records, one for each step that recorded something."""

import sqlalchemy as sa
from alembic import op

revision = "0003"
down_revision = "0002"


def upgrade() -> None:
    """Add the table; a ledger is signed from its first row on."""
    whole = sa.BigInteger().with_variant(sa.Integer(), "sqlite")
    op.create_table(
        "head",
        sa.Column("place", whole, primary_key=True, autoincrement=False),
        sa.Column("seq", whole, nullable=False),
        *(
            sa.Column(name, sa.Text, nullable=False)
            for name in ("ledger", "root", "link", "created", "key", "signature")
        ),
        sa.Column("frontier", sa.Text, nullable=True),
    )
    op.create_index("ix_head_seq", "head", ["seq"])
