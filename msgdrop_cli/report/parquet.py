"""Tables as Parquet, by pyarrow, which comes with an extra."""

import io

from msgdrop_cli.errors import DefinitionError, to_install
from msgdrop_cli.report.tidy import Columns


def parquet_bytes(columns: Columns) -> bytes:
    """One table; DefinitionError without pyarrow."""
    try:
        import pyarrow
        import pyarrow.parquet
    except ImportError as error:
        problem = "Parquet needs pyarrow (csv has the same tables)"
        raise DefinitionError(f"{problem}; {to_install('parquet')}") from error
    buffer = io.BytesIO()
    pyarrow.parquet.write_table(pyarrow.table(columns), buffer)
    return buffer.getvalue()
