"""A mesh, a field and a basis of each kind on a server, for random requests to ask for: python objects.py URL MESH FILE KEY."""

import json
import sys
import urllib.request

JOBS = [
    ("eigenbasis", {"count": 12, "method": "hsim"}),
    ("eigenbasis", {"count": 12, "method": "approximate"}),
    ("field_basis", {"dimension": 40}),
    ("operator_family", {"dimension": 20}),
    ("vibration_basis", {"count": 8, "thickness": 0.01}),
]


def call(url: str, body: bytes | None = None, media_type: str = "application/json") -> dict:
    request = urllib.request.Request(url, data=body, headers={"Authorization": f"Bearer {key}", "Content-Type": media_type})
    with urllib.request.urlopen(request, timeout=90) as answer:
        return json.load(answer)


url, mesh_file, out, key = sys.argv[1:]
with open(mesh_file, "rb") as file:
    stored = call(f"{url}/v1/meshes", file.read(), "model/ply")
mesh = stored["id"]
field = call(f"{url}/v1/meshes/{mesh}/fields", json.dumps({"values": [1.0] * stored["faces"]}).encode())["id"]
jobs, bases = [], []
for kind, parameters in JOBS:
    job = call(f"{url}/v1/jobs", json.dumps({"kind": kind, "mesh": mesh, "parameters": parameters}).encode())
    done = call(f"{url}/v1/jobs/{job['id']}?wait=60s")
    assert done["status"] == "succeeded", done
    jobs.append(job["id"])
    bases.append((kind, done["basis"]))
with open(out, "w", encoding="utf-8") as file:
    json.dump({"mesh": mesh, "field": field, "jobs": jobs, "bases": bases}, file)
