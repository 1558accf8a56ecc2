"""State of the service: tables, migrations, transactions."""
