"""Tasks on the workers of a Dask cluster, which may be other machines.

joblib's own Dask backend waits for ever where a worker keeps dying, since it hears of results only,
and it cannot say which worker has what; so tasks go to Dask itself. What a run is, who may write
it and how it goes on is the scheduler's and the records' business, as everywhere.
"""
