import pytest

from tests.service import databases


@pytest.fixture(scope="session")
def postgres():
    with databases.postgres_server() as server:
        yield server


@pytest.fixture(params=databases.BACKENDS)
def database(request, tmp_path):
    server = request.getfixturevalue("postgres") if request.param == "postgresql" else None
    with databases.fresh_database(request.param, tmp_path, server) as database:
        yield database
