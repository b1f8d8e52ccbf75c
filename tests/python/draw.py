"""Uses the client that openapi-python-client has made: draws a mesh, then a stored mesh, by a job too.

Arguments: the folder of the client, the server's address, a mesh, and a folder for the pictures.
"""

import sys
import time
from io import BytesIO
from pathlib import Path

client_folder, address, mesh_path, out = sys.argv[1:]
sys.path.insert(0, client_folder)

from meshsnap_client import Client  # noqa: E402
from meshsnap_client.api.default import create_job, get_job, render, store_mesh, thumbnail  # noqa: E402
from meshsnap_client.models import Job, Mesh, Problem, RequestKeys, RequestOfMesh, RequestWire  # noqa: E402
from meshsnap_client.types import File  # noqa: E402

client = Client(base_url=address)


def mesh():
    return File(payload=BytesIO(Path(mesh_path).read_bytes()))


def keep(name, picture):
    assert isinstance(picture, File), picture
    Path(out, name).write_bytes(picture.payload.read())


keep("body.png", render.sync(client=client, body=mesh(), keys=RequestKeys(size=48, style="wire")))

stored = store_mesh.sync(client=client, body=mesh())
assert isinstance(stored, Mesh), stored
document = RequestOfMesh(mesh=stored.sha256, size=48, wire=RequestWire(color="#f00"))
keep("stored.png", render.sync(client=client, body=document))
keep("thumbnail.webp", thumbnail.sync(stored.sha256, "webp", client=client, keys=RequestKeys(size=48)))

job = create_job.sync(client=client, body=document)
assert isinstance(job, Job), job
deadline = time.monotonic() + 60
while job.state not in ("done", "failed", "cancelled") and time.monotonic() < deadline:
    job = get_job.sync(job.id, client=client, prefer="wait=5")
assert job.state == "done", job
# A result may be a verdict too, and the generator takes JSON where there is a choice.
picture = client.get_httpx_client().get(job.result.url)
assert picture.status_code == 200, picture
Path(out, "job.png").write_bytes(picture.content)

refused = render.sync(client=client, body=mesh(), keys=RequestKeys(size=1_000_000))
assert isinstance(refused, Problem) and refused.code == "out_of_range", refused
print("5 answers")
