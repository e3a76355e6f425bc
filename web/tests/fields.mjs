// Fields in the page: n-fields, pins, prescribed singularities, tensor strokes, spaces that are finer here than there.

import assert from "node:assert/strict";
import { picture } from "./harness.mjs";
import { kit } from "./kit.mjs";

export async function fields(site) {
  const { test, keep, saved, chooser, unfold, opened, compute } = kit(site);
  const page = await site.open();
  const panel = page.locator("#panel-fields");
  const api = (path, body) => page.evaluate(async ([path, body]) => {
    const init = body ? { method: "POST", headers: { "Content-Type": "application/json" }, body: JSON.stringify(body) } : {};
    return (await fetch(path, init)).json();
  }, [path, body]);
  /** Computes a space, and waits until its first field is drawn. */
  const space = async (fields) => {
    await unfold(page);
    const before = await page.evaluate(() => {
      delete document.body.dataset.designed;
      return window.chladni.app.basis?.id;
    });
    await compute(page, fields);
    await page.waitForFunction((before) => window.chladni.app.basis && window.chladni.app.basis.id !== before && document.body.dataset.designed, before, { timeout: 60_000 });
    return page.evaluate(() => window.chladni.app.basis);
  };
  /** The next design that the page asks for with what is told apart by `which`, while `act` is done. */
  const asked = async (which, act) => {
    const request = page.waitForRequest((request) => /\/design\?/.test(request.url()) && which(request.postDataJSON()));
    await act();
    return (await request).postDataJSON();
  };
  const stroke = async (dx, dy, from = 0.5) => {
    const { x, y, width, height } = await page.locator("canvas.surface").first().boundingBox();
    await page.mouse.move(x + from * width, y + 0.45 * height);
    await page.mouse.down();
    await page.mouse.move(x + from * width + dx / 2, y + 0.45 * height + dy / 2, { steps: 3 });
    await page.mouse.move(x + from * width + dx, y + 0.45 * height + dy, { steps: 3 });
    await page.mouse.up();
  };
  const tap = async (s, t) => {
    const { x, y, width, height } = await page.locator("canvas.surface").first().boundingBox();
    await page.mouse.click(x + s * width, y + t * height);
  };

  await test("eigenfields of n-fields, and those above the first", async () => {
    await opened(page, "ball", "sphere", 1500);
    await page.getByRole("tab", { name: "Fields" }).click();
    for (const n of [1, 2, 3, 4, 6]) {
      const basis = await space({ Field: String(n), Dimension: "120" });
      assert.deepEqual([basis.parameters.field, basis.parameters.n], ["n_vector", n]);
      const first = await picture(page);
      const values = page.waitForResponse((response) => /eigenfields\?from=3&to=4/.test(response.url()));
      await page.getByRole("slider", { name: "Eigenfield" }).fill("3");
      await page.waitForFunction(() => document.body.dataset.eigenfield === "3");
      // Three numbers for each face: the first of n directions.
      assert.equal((await (await values).body()).length, 12 * (await page.evaluate(() => window.chladni.app.mesh.faces)));
      assert.match(await panel.innerText(), /Eigenfield 3: λ ≈ [\d.,]+/);
      assert.notDeepEqual(await picture(page), first);
      await page.getByRole("slider", { name: "Eigenfield" }).fill("0");
      await page.waitForFunction(() => document.body.dataset.eigenfield === "0");
      await keep(page, `field-${n}`);
    }
  });

  await test("a field has its length as colours, which are values to be saved", async () => {
    const plain = await picture(page);
    await page.getByLabel("colour by length").check();
    await page.locator(".legend").waitFor();
    assert.notDeepEqual(await picture(page), plain);
    const rows = String(await saved(page, "CSV")).trim().split("\n");
    assert.equal(rows.length, (await page.evaluate(() => window.chladni.app.mesh.vertices)) + 1);
    assert.ok(rows.slice(1).every((row) => Number(row.split(",")[4]) >= 0));
    // The vectors themselves, one for each face.
    const faces = await page.evaluate(() => window.chladni.app.mesh.faces);
    const array = await saved(page, "Field as NPY");
    assert.match(array.subarray(0, 128).toString("latin1"), new RegExp(`'shape': \\(${faces}, 3\\)`));
    const paraview = String(await saved(page, "Field as VTP"));
    const vectors = /<CellData>\n<DataArray [^>]*NumberOfComponents="3"[^>]*>\n([^<]*)<\/DataArray>/.exec(paraview)[1].trim().split("\n").map((row) => row.split(" ").map(Number));
    assert.equal(vectors.length, faces);
    vectors[17].forEach((x, k) => assert.ok(Math.abs(x - array.readFloatLE(array.length - 12 * faces + 12 * 17 + 4 * k)) < 1e-6));
    await page.getByLabel("colour by length").uncheck();
    await page.locator(".legend").waitFor({ state: "hidden" });
    assert.deepEqual(await picture(page), plain);
  });

  await test("a pin is met exactly", async () => {
    await space({ Field: "vector", Dimension: "150" });
    await chooser(page, "Pointer").selectOption("pin");
    const body = await asked(({ constraints }) => constraints.length === 1, () => stroke(40, 30));
    const [{ direction }] = body.constraints;
    assert.ok(Math.abs(Math.hypot(...direction) - 1) < 1e-6);
    const basis = await page.evaluate(() => window.chladni.app.basis.id);
    const answer = await api(`/v1/bases/${basis}/design?numbering=kept&form=world`, body);
    assert.ok(answer.residuals.length === 1 && answer.residuals[0] < 1e-4, `${answer.residuals}`);
    await panel.getByText(/Energy .*The smoothest of all fields of the surface\./).waitFor();
    await panel.getByRole("button", { name: "Clear" }).click();
    await page.getByRole("slider", { name: "Eigenfield" }).waitFor();
  });

  await test("singularities are where they were put, and exactly those where that is asked for", async () => {
    await chooser(page, "Pointer").selectOption("plus");
    await tap(0.42, 0.5);
    await panel.getByText("The indices add up to 1 so far; on this surface they have to make 2.").waitFor();
    const body = await asked(({ singularities }) => singularities?.at.length === 2, () => tap(0.58, 0.5));
    assert.ok(body.singularities.exact && body.singularities.at.every(({ index }) => index === 1));
    await panel.getByText(/2 singularities, indices sum to 2 \(Euler characteristic 2\).*Exactly those that were asked for/).waitFor();
    const basis = await page.evaluate(() => window.chladni.app.basis.id);
    const found = (await api(`/v1/bases/${basis}/design?numbering=kept&singularities=true`, body)).singularities;
    assert.deepEqual(found.map(({ vertex }) => vertex).sort(), body.singularities.at.map(({ vertex }) => vertex).sort());
    await keep(page, "singularities");
    const loose = await asked(({ singularities }) => singularities?.exact === false, () => page.getByLabel("singularities exactly").uncheck());
    assert.equal(loose.singularities.at.length, 2);
    // A tap on one takes it away again.
    await page.getByLabel("singularities exactly").check();
    await tap(0.42, 0.5);
    await panel.getByText("The indices add up to 1 so far").waitFor();
    await panel.getByRole("button", { name: "Clear" }).click();
    await chooser(page, "Pointer").selectOption("comb");
  });

  await test("an address holds strokes, singularities and sliders", async () => {
    const before = await asked(({ strokes }) => strokes.length === 1 && strokes[0].points.length > 4, () => stroke(60, 40));
    await page.getByRole("slider", { name: "Strength" }).fill("1");
    await chooser(page, "Show").selectOption("hatching");
    await page.waitForFunction(() => document.body.dataset.traced === "hatching");
    await page.waitForFunction(() => {
      const design = new URLSearchParams(location.hash.slice(1)).get("design");
      const state = design && JSON.parse(atob(design.replaceAll("-", "+").replaceAll("_", "/")));
      return state?.shown === "hatching" && state.strokes.length === 1 && state.knobs[0] === 1;
    });
    const context = await site.open("/");
    const request = context.waitForRequest((request) => /\/design\?/.test(request.url()));
    await context.evaluate((hash) => (location.hash = hash), await page.evaluate(() => location.hash));
    const again = (await request).postDataJSON();
    await context.waitForFunction(() => document.body.dataset.traced === "hatching");
    assert.equal(again.strokes[0].strength, 10);
    const radius = await page.evaluate(() => window.chladni.viewer.radius);
    before.strokes[0].points.forEach((point, i) => point.forEach((x, k) => assert.ok(Math.abs(x - again.strokes[0].points[i][k]) <= 0.0006 * radius)));
    await context.context().close();
    await panel.getByRole("button", { name: "Clear" }).click();
    await chooser(page, "Show").selectOption("glyphs");
  });

  await test("strokes bend tensors, along and across", async () => {
    await space({ Field: "tensor", Dimension: "120" });
    const plain = await picture(page);
    const body = await asked(({ strokes }) => strokes.length > 2, () => stroke(50, 20));
    const radius = await page.evaluate(() => window.chladni.viewer.radius);
    assert.ok(body.strokes.every(({ values, direction }) => Math.abs(values[0] * radius - 3) < 1e-9 && values[1] === 0 && Math.abs(Math.hypot(...direction) - 1) < 1e-6));
    assert.notDeepEqual(await picture(page), plain);
    const across = await asked(({ strokes }) => strokes.length > 2 && strokes[0].values[1] < 0, () => page.getByRole("slider", { name: "Across" }).fill("-2"));
    assert.ok(Math.abs(across.strokes[0].values[1] * radius + 2) < 1e-9);
    await panel.getByRole("button", { name: "Clear" }).click();
  });

  await test("a space is finer where the surface bends, or where a field changes", async () => {
    await opened(page, "edges", "starfish", 1500);
    const weighted = page.waitForRequest((request) => request.url().includes("/v1/jobs") && request.method() === "POST");
    await space({ Field: "4", Dimension: "120", Columns: "bending" });
    const { weights } = (await weighted).postDataJSON().parameters;
    assert.ok(weights.length === (await page.evaluate(() => window.chladni.app.mesh.faces)) && Math.min(...weights) === 1 && Math.max(...weights) > 2, `${weights.length} weights up to ${Math.max(...weights)}`);
    const derived = page.waitForRequest((request) => request.url().includes("/v1/jobs") && request.method() === "POST");
    await space({ Field: "4", Dimension: "120", Columns: "shown" });
    const { examples } = (await derived).postDataJSON().parameters;
    assert.deepEqual([examples.length, examples[0].length], [1, 2 * weights.length]);
  });
  await page.context().close();
}
