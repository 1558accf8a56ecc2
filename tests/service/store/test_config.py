import pytest
from pydantic import BaseModel

from service.config import Config, load_config
from service.config_example import example_config
from service.errors import UsageError


def test_the_example_reads_back_as_the_defaults(tmp_path):
    path = tmp_path / "residuum.toml"
    path.write_text(example_config())
    assert load_config(path) == Config() == load_config(None)


def test_every_field_says_what_it_does():
    text = example_config()

    def check(model):
        for name, field in model.model_fields.items():
            if isinstance(field.default, BaseModel):
                check(type(field.default))
            else:
                assert field.description
                assert set(field.json_schema_extra) == {"unit", "consequence"}, name
                assert field.json_schema_extra["consequence"] in text

    check(Config)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("[server]\nprot = 1", "unknown key 'server.prot'; did you mean 'port'"),
        ("[server]\nport = 0", "'server.port' .it is 0."),
        ("[nightly]\npolicy = 'always'", "nightly.policy"),
        ("[nightly]\nfalse_alarms_per_year = nan", "false_alarms_per_year"),
        ("[alerts.webhook]\nurl = 'https://x.example'", "secret_file"),
        ("[alerts.webhook]\nurl = 'file:///etc/passwd'", "alerts.webhook.url"),
        ("[server", "not valid TOML"),
    ],
)
def test_a_wrong_key_is_named(tmp_path, text, says):
    path = tmp_path / "residuum.toml"
    path.write_text(text)
    with pytest.raises(UsageError, match=says):
        load_config(path)


def test_a_missing_file_is_named(tmp_path):
    with pytest.raises(UsageError, match="cannot be read"):
        load_config(tmp_path / "none.toml")
