"""Checks the files of deploy/ by the schemas of Kubernetes, and prints what they set, as JSON.

Arguments: the folder deploy/.
"""

import json
import sys
from pathlib import Path

import kubernetes_validate
import yaml

deploy = Path(sys.argv[1])
settings, probes, schemas = {}, [], 0

for path in sorted((deploy / "kubernetes").glob("*.yaml")):
    for document in yaml.safe_load_all(path.read_text()):
        if document["kind"] == "Kustomization":
            listed = set(document["resources"])
            found = {file.name for file in (deploy / "kubernetes").glob("*.yaml")} - {path.name}
            assert listed == found, (listed, found)
            continue
        kubernetes_validate.validate(document, "1.37", strict=True)
        schemas += 1
        if document["kind"] != "StatefulSet":
            continue
        pod = document["spec"]["template"]["spec"]
        assert pod["securityContext"]["runAsNonRoot"] and pod["automountServiceAccountToken"] is False
        for container in pod["containers"]:
            security = container["securityContext"]
            assert security["readOnlyRootFilesystem"] and security["allowPrivilegeEscalation"] is False, security
            assert container["resources"]["limits"]["memory"]
            settings |= {entry["name"]: entry["value"] for entry in container["env"]}
            probes += [container[kind]["httpGet"]["path"] for kind in ("startupProbe", "livenessProbe", "readinessProbe")]
            mounts = {mount["name"] for mount in container["volumeMounts"]}
            volumes = {volume["name"] for volume in pod["volumes"]}
            claims = {claim["metadata"]["name"] for claim in document["spec"]["volumeClaimTemplates"]}
            assert mounts == volumes | claims, (mounts, volumes, claims)

compose = yaml.safe_load((deploy / "compose/compose.yml").read_text())
for service in compose["services"].values():
    assert service["read_only"] and service["cap_drop"] == ["ALL"], service
    settings |= service["environment"]
    assert set(service["secrets"]) <= set(compose["secrets"])
    assert {volume.split(":")[0] for volume in service["volumes"]} <= set(compose["volumes"])
    assert (deploy / "compose" / service["build"]["context"] / "Dockerfile").is_file()

print(json.dumps({"settings": settings, "probes": probes, "schemas": schemas}))
