"""How alembic reaches the ledger: always with the engine it is handed."""

from alembic import context

from inclinometry.store.schema import METADATA, protect

engine = context.config.attributes["engine"]
with engine.connect().execution_options(writing=True) as connection:
    context.configure(connection=connection, target_metadata=METADATA, render_as_batch=True)
    with context.begin_transaction():
        context.run_migrations()
        protect(connection)
    connection.commit()
