"""First tables."""

import sqlalchemy as sa
from alembic import op

from service.store.base import Utc

revision = "0001"
down_revision = None
branch_labels = None
depends_on = None

# a migration is history: it lists what was append-only then, and does not follow later code
_APPEND_ONLY = ("audit_log", "calibration_events", "calibrations", "estimates", "nights", "robot_models")
_TABLES = (
    "audit_log",
    "events",
    "remembered_requests",
    "robots",
    "tokens",
    "jobs",
    "leases",
    "recordings",
    "robot_models",
    "diagnoses",
    "excitations",
    "fits",
    "runs",
    "estimates",
    "calibrations",
    "nights",
    "calibration_events",
)


_INDEXED = (
    ("audit_log", "action"),
    ("audit_log", "who"),
    ("events", "subject_id"),
    ("remembered_requests", "at"),
    ("jobs", "robot_serial"),
    ("jobs", "state"),
    ("recordings", "robot_serial"),
    ("diagnoses", "recording_id"),
    ("diagnoses", "robot_serial"),
    ("excitations", "robot_serial"),
    ("fits", "recording_id"),
    ("fits", "robot_serial"),
    ("runs", "robot_serial"),
    ("runs", "state"),
    ("estimates", "robot_serial"),
    ("calibrations", "robot_serial"),
    ("nights", "robot_serial"),
    ("calibration_events", "calibration_id"),
    ("calibration_events", "robot_serial"),
)


def upgrade() -> None:
    """Go to this version."""
    op.create_table(
        "audit_log",
        sa.Column("id", sa.Integer(), autoincrement=True, nullable=False),
        sa.Column("who", sa.String(), nullable=False),
        sa.Column("action", sa.String(), nullable=False),
        sa.Column("subject", sa.String(), nullable=False),
        sa.Column("content", sa.JSON(none_as_null=True), nullable=False),
        sa.Column("at", Utc(), nullable=False),
        sa.PrimaryKeyConstraint("id", name="pk_audit_log"),
    )

    op.create_table(
        "events",
        sa.Column("id", sa.Integer(), autoincrement=True, nullable=False),
        sa.Column("kind", sa.String(), nullable=False),
        sa.Column("subject_id", sa.String(), nullable=False),
        sa.Column("content", sa.JSON(none_as_null=True), nullable=False),
        sa.Column("at", Utc(), nullable=False),
        sa.PrimaryKeyConstraint("id", name="pk_events"),
    )

    op.create_table(
        "remembered_requests",
        sa.Column("owner", sa.String(), nullable=False),
        sa.Column("key", sa.String(), nullable=False),
        sa.Column("digest", sa.String(), nullable=False),
        sa.Column("status", sa.Integer(), nullable=False),
        sa.Column("location", sa.String(), nullable=True),
        sa.Column("content", sa.JSON(none_as_null=True), nullable=False),
        sa.Column("at", Utc(), nullable=False),
        sa.PrimaryKeyConstraint("owner", "key", name="pk_remembered_requests"),
    )

    op.create_table(
        "robots",
        sa.Column("serial", sa.String(), nullable=False),
        sa.Column("name", sa.String(), nullable=False),
        sa.Column("simulated", sa.Boolean(), nullable=False),
        sa.Column("unattended", sa.Boolean(), nullable=False),
        sa.Column("model_hash", sa.String(), nullable=False),
        sa.Column("created_at", Utc(), nullable=False),
        sa.PrimaryKeyConstraint("serial", name="pk_robots"),
    )
    op.create_table(
        "tokens",
        sa.Column("id", sa.String(), nullable=False),
        sa.Column("name", sa.String(), nullable=False),
        sa.Column("digest", sa.String(), nullable=False),
        sa.Column("scopes", sa.String(), nullable=False),
        sa.Column("created_at", Utc(), nullable=False),
        sa.Column("expires_at", Utc(), nullable=True),
        sa.Column("revoked_at", Utc(), nullable=True),
        sa.PrimaryKeyConstraint("id", name="pk_tokens"),
        sa.UniqueConstraint("digest", name="uq_tokens_digest"),
        sa.UniqueConstraint("name", name="uq_tokens_name"),
    )
    op.create_table(
        "jobs",
        sa.Column("id", sa.String(), nullable=False),
        sa.Column("kind", sa.String(), nullable=False),
        sa.Column("subject_id", sa.String(), nullable=False),
        sa.Column("robot_serial", sa.String(), nullable=False),
        sa.Column("state", sa.String(), nullable=False),
        sa.Column("stage", sa.String(), nullable=False),
        sa.Column("progress", sa.Double(), nullable=False),
        sa.Column("attempts", sa.Integer(), nullable=False),
        sa.Column("cancel_requested", sa.Boolean(), nullable=False),
        sa.Column("error", sa.JSON(none_as_null=True), nullable=True),
        sa.Column("created_by", sa.String(), nullable=False),
        sa.Column("created_at", Utc(), nullable=False),
        sa.Column("started_at", Utc(), nullable=True),
        sa.Column("finished_at", Utc(), nullable=True),
        sa.ForeignKeyConstraint(["robot_serial"], ["robots.serial"], name="fk_jobs_robot_serial"),
        sa.PrimaryKeyConstraint("id", name="pk_jobs"),
    )

    op.create_table(
        "leases",
        sa.Column("robot_serial", sa.String(), nullable=False),
        sa.Column("owner", sa.String(), nullable=False),
        sa.Column("purpose", sa.String(), nullable=False),
        sa.Column("created_at", Utc(), nullable=False),
        sa.Column("expires_at", Utc(), nullable=False),
        sa.ForeignKeyConstraint(["robot_serial"], ["robots.serial"], name="fk_leases_robot_serial"),
        sa.PrimaryKeyConstraint("robot_serial", name="pk_leases"),
    )
    op.create_table(
        "recordings",
        sa.Column("id", sa.String(), nullable=False),
        sa.Column("sha256", sa.String(), nullable=False),
        sa.Column("label", sa.String(), nullable=False),
        sa.Column("size_bytes", sa.BigInteger(), nullable=False),
        sa.Column("robot_serial", sa.String(), nullable=False),
        sa.Column("kind", sa.String(), nullable=False),
        sa.Column("simulated", sa.Boolean(), nullable=False),
        sa.Column("facts", sa.JSON(none_as_null=True), nullable=False),
        sa.Column("created_by", sa.String(), nullable=False),
        sa.Column("created_at", Utc(), nullable=False),
        sa.ForeignKeyConstraint(["robot_serial"], ["robots.serial"], name="fk_recordings_robot_serial"),
        sa.PrimaryKeyConstraint("id", name="pk_recordings"),
        sa.UniqueConstraint("sha256", name="uq_recordings_sha256"),
    )

    op.create_table(
        "robot_models",
        sa.Column("id", sa.String(), nullable=False),
        sa.Column("robot_serial", sa.String(), nullable=False),
        sa.Column("model_hash", sa.String(), nullable=False),
        sa.Column("toml_text", sa.String(), nullable=False),
        sa.Column("urdf_text", sa.String(), nullable=False),
        sa.Column("created_at", Utc(), nullable=False),
        sa.ForeignKeyConstraint(["robot_serial"], ["robots.serial"], name="fk_robot_models_robot_serial"),
        sa.PrimaryKeyConstraint("id", name="pk_robot_models"),
        sa.UniqueConstraint("robot_serial", "model_hash", name="uq_robot_models_version"),
    )
    op.create_table(
        "diagnoses",
        sa.Column("id", sa.String(), nullable=False),
        sa.Column("job_id", sa.String(), nullable=False),
        sa.Column("robot_serial", sa.String(), nullable=False),
        sa.Column("recording_id", sa.String(), nullable=False),
        sa.Column("validation_id", sa.String(), nullable=True),
        sa.Column("options", sa.JSON(none_as_null=True), nullable=False),
        sa.Column("verdict", sa.String(), nullable=True),
        sa.Column("simulated", sa.Boolean(), nullable=True),
        sa.Column("content", sa.JSON(none_as_null=True), nullable=True),
        sa.Column("created_at", Utc(), nullable=False),
        sa.ForeignKeyConstraint(["job_id"], ["jobs.id"], name="fk_diagnoses_job_id"),
        sa.ForeignKeyConstraint(["recording_id"], ["recordings.id"], name="fk_diagnoses_recording_id"),
        sa.ForeignKeyConstraint(["robot_serial"], ["robots.serial"], name="fk_diagnoses_robot_serial"),
        sa.ForeignKeyConstraint(["validation_id"], ["recordings.id"], name="fk_diagnoses_validation_id"),
        sa.PrimaryKeyConstraint("id", name="pk_diagnoses"),
    )

    op.create_table(
        "excitations",
        sa.Column("id", sa.String(), nullable=False),
        sa.Column("job_id", sa.String(), nullable=False),
        sa.Column("robot_serial", sa.String(), nullable=False),
        sa.Column("model_hash", sa.String(), nullable=False),
        sa.Column("options", sa.JSON(none_as_null=True), nullable=False),
        sa.Column("content", sa.JSON(none_as_null=True), nullable=True),
        sa.Column("created_at", Utc(), nullable=False),
        sa.ForeignKeyConstraint(["job_id"], ["jobs.id"], name="fk_excitations_job_id"),
        sa.ForeignKeyConstraint(["robot_serial"], ["robots.serial"], name="fk_excitations_robot_serial"),
        sa.PrimaryKeyConstraint("id", name="pk_excitations"),
    )

    op.create_table(
        "fits",
        sa.Column("id", sa.String(), nullable=False),
        sa.Column("job_id", sa.String(), nullable=False),
        sa.Column("robot_serial", sa.String(), nullable=False),
        sa.Column("recording_id", sa.String(), nullable=False),
        sa.Column("validation_id", sa.String(), nullable=True),
        sa.Column("options", sa.JSON(none_as_null=True), nullable=False),
        sa.Column("estimate_id", sa.String(), nullable=True),
        sa.Column("created_at", Utc(), nullable=False),
        sa.ForeignKeyConstraint(["job_id"], ["jobs.id"], name="fk_fits_job_id"),
        sa.ForeignKeyConstraint(["recording_id"], ["recordings.id"], name="fk_fits_recording_id"),
        sa.ForeignKeyConstraint(["robot_serial"], ["robots.serial"], name="fk_fits_robot_serial"),
        sa.ForeignKeyConstraint(["validation_id"], ["recordings.id"], name="fk_fits_validation_id"),
        sa.PrimaryKeyConstraint("id", name="pk_fits"),
    )

    op.create_table(
        "runs",
        sa.Column("id", sa.String(), nullable=False),
        sa.Column("robot_serial", sa.String(), nullable=False),
        sa.Column("state", sa.String(), nullable=False),
        sa.Column("simulated", sa.Boolean(), nullable=False),
        sa.Column("request", sa.JSON(none_as_null=True), nullable=False),
        sa.Column("preview", sa.JSON(none_as_null=True), nullable=False),
        sa.Column("progress", sa.JSON(none_as_null=True), nullable=True),
        sa.Column("process_id", sa.Integer(), nullable=True),
        sa.Column("recording_id", sa.String(), nullable=True),
        sa.Column("error", sa.JSON(none_as_null=True), nullable=True),
        sa.Column("created_by", sa.String(), nullable=False),
        sa.Column("created_at", Utc(), nullable=False),
        sa.Column("finished_at", Utc(), nullable=True),
        sa.ForeignKeyConstraint(["recording_id"], ["recordings.id"], name="fk_runs_recording_id"),
        sa.ForeignKeyConstraint(["robot_serial"], ["robots.serial"], name="fk_runs_robot_serial"),
        sa.PrimaryKeyConstraint("id", name="pk_runs"),
    )

    op.create_table(
        "estimates",
        sa.Column("id", sa.String(), nullable=False),
        sa.Column("fit_id", sa.String(), nullable=False),
        sa.Column("robot_serial", sa.String(), nullable=False),
        sa.Column("recording_id", sa.String(), nullable=False),
        sa.Column("model_hash", sa.String(), nullable=False),
        sa.Column("simulated", sa.Boolean(), nullable=False),
        sa.Column("intervals_valid", sa.Boolean(), nullable=False),
        sa.Column("content", sa.JSON(none_as_null=True), nullable=False),
        sa.Column("created_at", Utc(), nullable=False),
        sa.ForeignKeyConstraint(["fit_id"], ["fits.id"], name="fk_estimates_fit_id"),
        sa.ForeignKeyConstraint(["recording_id"], ["recordings.id"], name="fk_estimates_recording_id"),
        sa.ForeignKeyConstraint(["robot_serial"], ["robots.serial"], name="fk_estimates_robot_serial"),
        sa.PrimaryKeyConstraint("id", name="pk_estimates"),
    )

    op.create_table(
        "calibrations",
        sa.Column("id", sa.String(), nullable=False),
        sa.Column("robot_serial", sa.String(), nullable=False),
        sa.Column("model_hash", sa.String(), nullable=False),
        sa.Column("estimate_id", sa.String(), nullable=False),
        sa.Column("simulated", sa.Boolean(), nullable=False),
        sa.Column("created_by", sa.String(), nullable=False),
        sa.Column("created_at", Utc(), nullable=False),
        sa.ForeignKeyConstraint(["estimate_id"], ["estimates.id"], name="fk_calibrations_estimate_id"),
        sa.ForeignKeyConstraint(["robot_serial"], ["robots.serial"], name="fk_calibrations_robot_serial"),
        sa.PrimaryKeyConstraint("id", name="pk_calibrations"),
        sa.UniqueConstraint("estimate_id", name="uq_calibrations_estimate_id"),
    )

    op.create_table(
        "nights",
        sa.Column("id", sa.String(), nullable=False),
        sa.Column("robot_serial", sa.String(), nullable=False),
        sa.Column("outcome", sa.String(), nullable=False),
        sa.Column("sentence", sa.String(), nullable=False),
        sa.Column("estimate_id", sa.String(), nullable=True),
        sa.Column("content", sa.JSON(none_as_null=True), nullable=False),
        sa.Column("created_by", sa.String(), nullable=False),
        sa.Column("created_at", Utc(), nullable=False),
        sa.ForeignKeyConstraint(["estimate_id"], ["estimates.id"], name="fk_nights_estimate_id"),
        sa.ForeignKeyConstraint(["robot_serial"], ["robots.serial"], name="fk_nights_robot_serial"),
        sa.PrimaryKeyConstraint("id", name="pk_nights"),
    )

    op.create_table(
        "calibration_events",
        sa.Column("id", sa.Integer(), autoincrement=True, nullable=False),
        sa.Column("calibration_id", sa.String(), nullable=False),
        sa.Column("robot_serial", sa.String(), nullable=False),
        sa.Column("event", sa.String(), nullable=False),
        sa.Column("state", sa.String(), nullable=False),
        sa.Column("simulated", sa.Boolean(), nullable=False),
        sa.Column("robot_simulated", sa.Boolean(), nullable=False),
        sa.Column("reason", sa.String(), nullable=False),
        sa.Column("by", sa.String(), nullable=False),
        sa.Column("at", Utc(), nullable=False),
        sa.CheckConstraint(
            "NOT (state = 'accepted' AND simulated AND NOT robot_simulated)",
            name="ck_calibration_events_simulated",
        ),
        sa.ForeignKeyConstraint(
            ["calibration_id"], ["calibrations.id"], name="fk_calibration_events_calibration_id"
        ),
        sa.ForeignKeyConstraint(
            ["robot_serial"], ["robots.serial"], name="fk_calibration_events_robot_serial"
        ),
        sa.PrimaryKeyConstraint("id", name="pk_calibration_events"),
    )
    for table, column in _INDEXED:
        op.create_index(f"ix_{table}_{column}", table, [column])
    _protect()


def _protect() -> None:
    """Let the database itself refuse to rewrite history."""
    postgres = op.get_bind().dialect.name == "postgresql"
    if postgres:
        op.execute(
            "CREATE FUNCTION refuse_rewriting() RETURNS trigger LANGUAGE plpgsql AS "
            "$$ BEGIN RAISE EXCEPTION 'rows of % are only ever added', TG_TABLE_NAME; END $$"
        )
    for table in _APPEND_ONLY:
        if postgres:
            op.execute(
                f"CREATE TRIGGER {table}_append_only BEFORE UPDATE OR DELETE ON {table} "
                "FOR EACH ROW EXECUTE FUNCTION refuse_rewriting()"
            )
            continue
        for verb in ("UPDATE", "DELETE"):
            op.execute(
                f"CREATE TRIGGER {table}_no_{verb.lower()} BEFORE {verb} ON {table} "
                f"BEGIN SELECT RAISE(ABORT, 'rows of {table} are only ever added'); END"
            )


def downgrade() -> None:
    """Go back to the version before."""
    for table in reversed(_TABLES):
        op.drop_table(table)
    if op.get_bind().dialect.name == "postgresql":
        op.execute("DROP FUNCTION refuse_rewriting()")
