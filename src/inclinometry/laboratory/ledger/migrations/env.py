"""How alembic reaches the ledger: always with the engine it is handed."""

from alembic import context

from inclinometry.laboratory.ledger.engine import METADATA, protect

engine = context.config.attributes["engine"]
with engine.connect().execution_options(writing=True) as connection:
    context.configure(connection=connection, target_metadata=METADATA, render_as_batch=True)
    with context.begin_transaction():
        before = context.get_context().get_current_revision()
        context.run_migrations()
        if context.get_context().get_current_revision() != before:
            # a ledger that was not changed here keeps its triggers, or the lack of them: that is evidence
            protect(connection)
    connection.commit()
