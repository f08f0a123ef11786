"""Migrations of the ledger, one file a revision; none goes back."""
