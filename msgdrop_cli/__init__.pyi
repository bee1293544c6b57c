from msgdrop_cli.engine.policy import Policy as Policy
from msgdrop_cli.engine.policy import load_policy as load_policy
from msgdrop_cli.networks.message_dropout import MessageDropout as MessageDropout
from msgdrop_cli.networks.message_dropout import message_dropout as message_dropout
from msgdrop_cli.report.frames import curves as curves
from msgdrop_cli.report.frames import results as results

__version__: str
