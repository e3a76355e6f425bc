// What one looks at: colour maps, ranges, slices, fields among the modes, comparisons, compression, and little motion.

import assert from "node:assert/strict";
import { readFileSync } from "node:fs";
import { join } from "node:path";
import { picture } from "./harness.mjs";
import { kit } from "./kit.mjs";

export async function looks(site) {
  const { test, keep, saved, changed, chooser, onSurface, unfold, opened, compute, violations } = kit(site);
  const page = await site.open();
  /** The surface alone, without what stands over it. */
  const seen = () => page.evaluate(async () => (await window.chladni.viewer.snapshot()).arrayBuffer().then((bytes) => [...new Uint8Array(bytes)].join()));
  const labels = () => page.locator(".legend .labels span").allInnerTexts();

  await test("colour maps, isolines and the range are chosen, and the legend says what colours mean", async () => {
    await opened(page, "ring", "torus", 1500, 40);
    await page.waitForFunction(() => document.body.dataset.mode === "1");
    const shots = [await picture(page)];
    const values = await page.evaluate(async () => {
      const { app } = window.chladni;
      return [...new Float32Array(await (await fetch(`${app.basis.links.modes}?from=1&to=2&format=f32`)).arrayBuffer())];
    });
    const most = Math.max(...values.map(Math.abs));
    assert.deepEqual(await labels(), [-most, 0, most].map((value) => String(Number(value.toPrecision(3)))));
    assert.match(await page.locator("canvas.histogram").getAttribute("aria-label"), new RegExp(`^Histogram of ${values.length.toLocaleString("en-GB")} values from`));
    const painted = () => page.evaluate(() => {
      const canvas = document.querySelector("canvas.histogram");
      return canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height).data.reduce((sum, x) => sum + x, 0);
    });
    assert.ok((await painted()) > 0);
    await chooser(page, "Colours").selectOption("purple-green");
    assert.match(await page.evaluate(() => location.hash), /map=purple-green/);
    shots.push(await picture(page));
    await page.getByRole("slider", { name: "Isolines" }).fill("0");
    shots.push(await picture(page));
    await page.getByLabel("Colours begin at").fill("0");
    await page.getByLabel("Colours begin at").press("Enter");
    assert.deepEqual((await labels())[0], "0");
    shots.push(await picture(page));
    assert.equal(new Set(shots.map((bytes) => bytes.toString("base64"))).size, shots.length);
    // Ends in the wrong order change places, and what would leave nothing between them is refused where it is typed.
    await page.getByLabel("Colours end at").fill("-0.5");
    await page.getByLabel("Colours end at").press("Enter");
    assert.deepEqual([(await labels())[0], (await labels())[2], await page.getByLabel("Colours begin at").inputValue(), await page.getByLabel("Colours end at").inputValue()], ["-0.5", "0", "-0.5", "0"]);
    const refused = () => page.getByLabel("Colours end at").evaluate((input) => input.validationMessage);
    await page.getByLabel("Colours end at").fill("-0.5");
    await page.getByLabel("Colours end at").press("Enter");
    assert.equal(await refused(), "The range must end above -0.5.");
    await page.getByLabel("Colours end at").fill("");
    await page.getByLabel("Colours end at").press("Enter");
    assert.equal(await refused(), "");
    // Functions without a sign have maps of their own.
    await page.getByRole("tab", { name: "Distances" }).click();
    await changed(page, "field");
    assert.deepEqual(await chooser(page, "Colours").locator("option").allInnerTexts(), ["Cividis", "Viridis"]);
    const viridis = await picture(page);
    await chooser(page, "Colours").selectOption("cividis");
    assert.notDeepEqual(await picture(page), viridis);
    await page.getByRole("tab", { name: "Modes" }).click();
    await page.getByLabel("Colours begin at").fill("");
    await page.getByLabel("Colours begin at").press("Enter");
  });

  await test("a plane slices the surface, and what it cut away is not clicked any more", async () => {
    await changed(page, "mode");
    const whole = await seen();
    const top = await page.evaluate(() => {
      const { viewer } = window.chladni;
      const box = viewer.canvas.getBoundingClientRect();
      for (let t = 0; t < 1; t += 0.005) if (viewer.pick(box.left + 0.5 * box.width, box.top + (t + 0.02) * box.height)) return [box.left + 0.5 * box.width, box.top + (t + 0.02) * box.height];
      return null;
    });
    await page.locator(".slice summary").click();
    await page.getByRole("combobox", { name: "Slice" }).selectOption("1");
    await page.getByRole("slider", { name: "At" }).fill("0.4");
    const cut = await seen();
    assert.notEqual(cut, whole);
    assert.deepEqual(await violations(page), []);
    await keep(page, "slice");
    // What is seen there now lies below the plane.
    const [height, plane] = await page.evaluate((top) => {
      const { viewer } = window.chladni;
      const heights = viewer.resting.filter((_, i) => i % 3 === { y: 1, z: 2 }[viewer.up]);
      const [low, high] = heights.reduce(([low, high], x) => [Math.min(low, x), Math.max(high, x)], [Infinity, -Infinity]);
      const hit = viewer.pick(...top);
      return [hit ? hit.point[{ y: 1, z: 2 }[viewer.up]] : -Infinity, low + 0.4 * (high - low)];
    }, top);
    assert.ok(height <= plane + 1e-6, `${height} above ${plane}`);
    await page.getByLabel("cut the far part away").uncheck();
    assert.notEqual(await seen(), cut);
    await page.getByRole("combobox", { name: "Slice" }).selectOption("none");
    await page.keyboard.press("Escape");
    assert.ok((await seen()) === whole);
  });

  await test("fields are among the modes, each with its part", async () => {
    await unfold(page);
    await compute(page, { Operator: "hodge", Eigenpairs: "12", Tolerance: "1e-4" });
    await page.waitForFunction(() => window.chladni.app.basis?.parameters.operator === "hodge" && document.body.dataset.mode !== undefined, null, { timeout: 60_000 });
    // A torus has two harmonic fields.
    await page.getByRole("button", { name: "2 harmonic fields" }).click();
    await page.waitForFunction(() => document.body.dataset.mode === "0");
    assert.match(await page.locator("#panel-modes .facts").innerText(), /harmonic/);
    assert.match(await page.locator(".certificate").innerText(), /12 eigenfields of the Hodge–Laplacian: 2 harmonic, 5 gradients, 5 co-gradients/);
    const harmonic = await picture(page);
    await keep(page, "hodge");
    await page.getByRole("button", { name: "5 gradients" }).click();
    await page.waitForFunction(() => Number(document.body.dataset.mode) >= 2);
    assert.match(await page.locator("#panel-modes .facts").innerText(), /gradient/);
    assert.notDeepEqual(await picture(page), harmonic);
    // No other tab of functions takes them.
    await page.getByRole("tab", { name: "Filter" }).click();
    await page.waitForFunction(() => window.chladni.app.basis?.parameters.operator === "auto");
  });

  await test("two bases are compared, pair by pair and space by space", async () => {
    await page.getByRole("tab", { name: "Modes" }).click();
    await unfold(page);
    await compute(page, { Operator: "auto", Eigenpairs: "30", Method: "hsim", Tolerance: "1e-6" });
    await page.waitForFunction(() => window.chladni.app.basis?.count === 30 && document.body.dataset.mode !== undefined);
    await page.getByText("Compare with another basis").click();
    // Fields and functions are not compared with each other.
    const options = await chooser(page, "Reference").locator("option").allInnerTexts();
    assert.deepEqual([options.length, options.some((text) => text.includes("hodge"))], [2, false]);
    await chooser(page, "Reference").selectOption({ index: 1 });
    await page.waitForFunction(() => document.body.dataset.compared === "30");
    assert.match(await page.locator("#panel-modes").innerText(), /30 pairs in \d+ eigenspaces: eigenvalues differ by up to .* %, and the eigenspace of modes? \d+( to \d+)? is turned most, sin θ = /);
    await page.getByText("A row for each mode of the reference").scrollIntoViewIfNeeded();
    await keep(page, "comparison");
  });

  await test("a surface is compressed, and an address holds how far", async () => {
    await page.getByRole("tab", { name: "Filter" }).click();
    await chooser(page, "Filter").selectOption("compression");
    await changed(page, "compressed");
    const before = await page.evaluate(() => document.body.dataset.compressed);
    await page.getByRole("slider", { name: "Bits" }).fill("4");
    await changed(page, "compressed", before);
    const [, bits, size] = (await page.evaluate(() => document.body.dataset.compressed)).split(" ").map(Number);
    assert.ok(bits === 4 && size < Number(before.split(" ")[2]), `${size} bytes`);
    const [file] = await Promise.all([page.waitForEvent("download"), page.getByRole("button", { name: "Save the bytes" }).click()]);
    const path = join(site.folder, file.suggestedFilename());
    await file.saveAs(path);
    assert.equal(readFileSync(path).length, size);
    await keep(page, "compression");
    await page.waitForFunction(() => JSON.parse(atob((new URLSearchParams(location.hash.slice(1)).get("design") ?? "bnVsbA").replaceAll("-", "+").replaceAll("_", "/")))?.bits === 4);
    const other = await site.open(`/${await page.evaluate(() => location.hash)}`);
    await other.waitForFunction((wanted) => document.body.dataset.compressed === wanted, await page.evaluate(() => document.body.dataset.compressed));
    await other.context().close();
    await chooser(page, "Filter").selectOption("curve");
  });

  await test("addresses hold the point that distances are measured from, and where the sliders of a family stand", async () => {
    await page.getByRole("tab", { name: "Distances" }).click();
    await changed(page, "field");
    await chooser(page, "Show").selectOption("biharmonic");
    await page.waitForFunction(() => document.body.dataset.field?.startsWith("biharmonic"));
    const uppermost = await page.evaluate(() => document.body.dataset.field);
    await page.mouse.click(...(await onSurface(page, 0.4)));
    await changed(page, "field", uppermost);
    const design = (name) => page.waitForFunction((name) => JSON.parse(atob((new URLSearchParams(location.hash.slice(1)).get("design") ?? "bnVsbA").replaceAll("-", "+").replaceAll("_", "/")))?.[name[0]] === name[1], name);
    const shown = await page.evaluate(() => document.body.dataset.field);
    await design(["vertex", Number(shown.split(" ")[1])]);
    const again = async (name, wanted) => {
      const other = await site.open(`/${await page.evaluate(() => location.hash)}`);
      await other.waitForFunction(([name, wanted]) => document.body.dataset[name] === wanted, [name, wanted]);
      await other.context().close();
    };
    await again("field", shown);
    await page.getByRole("tab", { name: "Family" }).click();
    await compute(page, { Dimension: "100" });
    await changed(page, "family");
    await page.getByRole("slider", { name: "Extrinsic t" }).fill("0.6");
    await page.waitForFunction(() => document.body.dataset.family?.startsWith("0.6 "));
    await design(["extrinsic", 0.6]);
    await again("family", await page.evaluate(() => document.body.dataset.family));
  });

  await test("an address that makes no sense opens its tab all the same", async () => {
    const mesh = await page.evaluate(() => window.chladni.app.mesh.id);
    const nonsense = ["x", [], 5, { strokes: 5, pins: [[1, "a"]], singular: [[-1, 1]], knobs: "no", curve: [1], beyond: "a", vertex: -3, what: "toString", extrinsic: null, other: 7, pairs: [[1], "b", [1e9, 0]], shown: "nothing" }];
    const visitor = await site.open("/");
    for (const tab of ["modes", "filter", "points", "fields", "family", "maps", "nowhere"]) {
      for (const design of [...nonsense.map((value) => Buffer.from(JSON.stringify(value)).toString("base64url")), "%%%", "e30"]) {
        await visitor.evaluate((hash) => (location.hash = hash), `#mesh=${mesh}&tab=${tab}&design=${design}`);
        await visitor.waitForFunction((tab) => window.chladni.app.place.tab === tab && window.chladni.app.panel.element.hidden === false, tab);
      }
    }
    assert.equal(await visitor.locator(".toast.error").count(), 0, await visitor.locator(".toasts").innerText());
    await visitor.context().close();
  });

  await test("a family of few dimensions shows all that it has", async () => {
    const visitor = await site.open("/");
    await opened(visitor, "few", "torus", 500);
    await visitor.evaluate(() => window.chladni.app.submit("operator_family", { dimension: 12 }));
    await visitor.getByRole("tab", { name: "Family" }).click();
    await visitor.waitForFunction(() => document.body.dataset.family);
    const { count } = await visitor.evaluate(() => window.chladni.app.basis);
    assert.ok(count < 60);
    assert.equal(await visitor.getByRole("slider", { name: "Mode" }).last().getAttribute("max"), String(count - 1));
    // One function alone is a pair too, and its residual is told.
    await visitor.evaluate(() => window.chladni.app.submit("eigenbasis", { count: 1, method: "hsim", tolerance: 1e-6 }));
    await visitor.waitForFunction(() => window.chladni.app.bases.some(({ kind }) => kind === "eigenbasis"));
    await visitor.getByRole("tab", { name: "Modes" }).click();
    await visitor.waitForFunction(() => document.body.dataset.mode === "0");
    assert.match(await visitor.locator(".certificate").innerText(), /^1 eigenpair of .*\s+Every pair has a residual of at most [\d.]+( · 10⁻[⁰¹²³⁴⁵⁶⁷⁸⁹]+)? /);
    await visitor.evaluate(() => window.chladni.app.remove());
    await visitor.context().close();
  });

  await test("what is shown becomes the potential of an operator", async () => {
    await page.getByRole("tab", { name: "Distances" }).click();
    await changed(page, "field");
    await unfold(page);
    const sent = page.waitForRequest((request) => request.url().includes("/v1/jobs") && request.method() === "POST");
    await compute(page, { Operator: "hamiltonian", Potential: "values", Eigenpairs: "20" });
    const { values } = (await sent).postDataJSON().parameters.operator.hamiltonian.potential;
    assert.ok(values.length === (await page.evaluate(() => window.chladni.app.mesh.vertices)) && Math.min(...values) === 0 && Math.max(...values) > 0);
    await page.waitForFunction(() => window.chladni.app.basis?.count === 20);
  });

  await test("a part of a surface that no way leads to has neither a colour nor a share in the range", async () => {
    const one = await page.evaluate(async () => {
      const { app, viewer } = window.chladni;
      const { positions: p, triangles: t } = viewer.surface;
      const lines = [];
      for (const along of [0, 4]) for (let v = 0; v < p.length; v += 3) lines.push(`v ${p[v] + along} ${p[v + 1]} ${p[v + 2]}`);
      for (const from of [1, 1 + p.length / 3]) for (let f = 0; f < t.length; f += 3) lines.push(`f ${t[f] + from} ${t[f + 1] + from} ${t[f + 2] + from}`);
      const mesh = await (await fetch("/v1/meshes?name=pair&format=obj", { method: "POST", body: lines.join("\n") })).json();
      await app.list();
      await app.open(mesh.id);
      await app.submit("eigenbasis", { count: 25 });
      return p.length / 3;
    });
    await page.getByRole("tab", { name: "Distances" }).click();
    await page.waitForFunction(() => window.chladni.app.mesh.name === "pair" && document.body.dataset.field);
    for (const what of ["geodesic", "exact"]) {
      await chooser(page, "Show").selectOption(what);
      await page.waitForFunction((what) => document.body.dataset.field.startsWith(`${what} `), what);
      const [least, , most] = (await labels()).map(Number);
      assert.ok(least === 0 && most > 1 && most < 10, `${await labels()}`);
      await page.getByText(`No way leads to ${one.toLocaleString("en-GB")} vertices`).waitFor();
    }
    const ply = await saved(page, "PLY with colours");
    const begin = ply.indexOf("end_header\n") + 11;
    const source = Number((await page.evaluate(() => document.body.dataset.field)).split(" ")[1]);
    const plain = (v) => [204, 201, 194].every((part, k) => ply[begin + 19 * v + 12 + k] === part);
    for (let v = 0; v < 2 * one; v++) assert.equal(plain(v), v < one !== source < one, `vertex ${v}`);
    // A potential has to be finite.
    await unfold(page);
    await compute(page, { Operator: "hamiltonian", Potential: "values", Eigenpairs: "20" });
    await page.getByRole("alert").getByText("It has to be finite everywhere").waitFor();
    await page.getByRole("button", { name: "Close" }).first().click();
  });

  await test("bounds are told relative to eigenvalues that are not zero, however many are", async () => {
    await page.getByRole("tab", { name: "Modes" }).click();
    await page.waitForFunction(() => window.chladni.app.mesh.name === "pair" && document.body.dataset.mode);
    const told = await page.locator(".certificate").innerText();
    const worst = await page.evaluate(() => {
      const { eigenvalues, certificate: { bounds } } = window.chladni.app.basis;
      return Math.max(...eigenvalues.map((value, k) => bounds[k] / value).slice(2));
    });
    // As "8.31 · 10⁻¹²" of it, or in percent.
    const [, size, sign, power, unit] = /, ([\d.,]+)(?: · 10(⁻?)([⁰¹²³⁴⁵⁶⁷⁸⁹]+))? (of it|%) at worst/.exec(told) ?? assert.fail(told);
    const exponent = power ? Number([...power].map((digit) => "⁰¹²³⁴⁵⁶⁷⁸⁹".indexOf(digit)).join("")) * (sign ? -1 : 1) : 0;
    const said = (Number(size) * 10 ** exponent) / (unit === "%" ? 100 : 1);
    assert.ok(Math.abs(said / worst - 1) < 0.01, `${said} for ${worst}`);
  });

  await test("no line covers a part of a surface on which nothing changes", async () => {
    const drawnWith = (lines) => page.evaluate(async (lines) => {
      const { viewer } = window.chladni;
      viewer.setScalar({ values: new Float32Array(viewer.surface.positions.length / 3), range: [-1, 1], diverging: true });
      viewer.lines(lines);
      return (await viewer.snapshot()).arrayBuffer().then((bytes) => [...new Uint8Array(bytes)].join());
    }, lines);
    assert.ok((await drawnWith(16)) === (await drawnWith(0)));
    await page.evaluate(() => window.chladni.viewer.lines(16));
  });

  await test("points without faces are seen, clicked and filtered", async () => {
    const before = await seen();
    await page.evaluate(async () => {
      const { app, viewer } = window.chladni;
      const p = viewer.surface.positions;
      const lines = [];
      for (let v = 0; v < p.length / 2; v += 3) lines.push(`v ${p[v]} ${p[v + 1]} ${p[v + 2]}`);
      const mesh = await (await fetch("/v1/meshes?name=points&format=obj", { method: "POST", body: lines.join("\n") })).json();
      await app.list();
      await app.open(mesh.id);
      await app.submit("eigenbasis", { count: 25 });
    });
    await page.waitForFunction(() => window.chladni.app.mesh.name === "points" && document.body.dataset.mode);
    assert.match(await page.locator("li.open .report").innerText(), /^points without faces · 1 component · area/);
    assert.notEqual(await seen(), before);
    await page.evaluate(() => window.chladni.viewer.setScalar(null));
    const plain = await seen();
    await page.getByRole("tab", { name: "Distances" }).click();
    // Along a surface there is no way: what is shown first is what can be had.
    await page.waitForFunction(() => document.body.dataset.field?.startsWith("biharmonic "));
    assert.notEqual(await seen(), plain);
    const field = await page.evaluate(() => document.body.dataset.field);
    await page.mouse.click(...(await onSurface(page)));
    await changed(page, "field", field);
    await chooser(page, "Show").selectOption("geodesic");
    await page.getByRole("alert").getByText("need a surface with faces").waitFor();
    assert.ok(await page.locator(".legend").isHidden());
    await page.getByRole("button", { name: "Close" }).first().click();
    await page.getByRole("tab", { name: "Filter" }).click();
    await page.getByRole("button", { name: "Smooth" }).click();
    await changed(page, "filtered");
    assert.notEqual(await seen(), plain);
    await page.getByRole("tab", { name: "Modes" }).click();
  });

  await test("a surface is seen in any unit, and that it lies too far away is told", async () => {
    const pair = await page.evaluate(() => window.chladni.app.meshes.find(({ name }) => name === "pair").id);
    await opened(page, "usual", "torus", 600);
    /** The part of the pixels that differ from those of the first picture. */
    const unlike = () => page.evaluate(async () => {
      const picture = await createImageBitmap(await window.chladni.viewer.snapshot());
      const context = new OffscreenCanvas(picture.width, picture.height).getContext("2d");
      context.drawImage(picture, 0, 0);
      const { data } = context.getImageData(0, 0, picture.width, picture.height);
      window.usual ??= data;
      return data.filter((part, k) => Math.abs(part - window.usual[k]) > 8).length / data.length;
    });
    assert.equal(await unlike(), 0);
    const placed = async (name, scale, offset) => {
      await page.evaluate(async ([name, scale, offset]) => {
        const { app, viewer } = window.chladni;
        window.first ??= { positions: viewer.surface.positions.slice(), triangles: viewer.surface.triangles.slice() };
        const { positions: p, triangles: t } = window.first;
        const lines = [];
        for (let v = 0; v < p.length; v += 3) lines.push(`v ${[0, 1, 2].map((k) => offset + scale * p[v + k]).join(" ")}`);
        for (let f = 0; f < t.length; f += 3) lines.push(`f ${t[f] + 1} ${t[f + 1] + 1} ${t[f + 2] + 1}`);
        const mesh = await (await fetch(`/v1/meshes?name=${name}&format=obj`, { method: "POST", body: lines.join("\n") })).json();
        await app.list();
        await app.open(mesh.id);
      }, [name, scale, offset]);
    };
    for (const scale of [1e25, 1e-25]) {
      await placed(`size${scale}`, scale, 0);
      assert.ok((await unlike()) < 0.005, `${scale}: ${await unlike()}`);
    }
    const report = () => page.locator("li.open .report").innerText();
    assert.doesNotMatch(await report(), /Far from the origin/);
    await placed("far", 1, 5e6);
    assert.match(await report(), /Far from the origin for its size: .* in steps of 0\.5\./);
    assert.ok((await unlike()) > 0.005);
    await page.evaluate((id) => window.chladni.app.open(id), pair);
    await page.getByRole("tab", { name: "Distances" }).click();
    await page.waitForFunction(() => document.body.dataset.field);
  });

  await test("a range holds in its tab, and not where other things are shown", async () => {
    await page.getByRole("tab", { name: "Modes" }).click();
    await changed(page, "mode");
    await page.getByLabel("Colours end at").fill("1e-3");
    await page.getByLabel("Colours end at").press("Enter");
    assert.equal((await labels())[2], "0.001");
    await page.getByRole("button", { name: "Next mode" }).click();
    await page.waitForFunction(() => document.body.dataset.mode === "2");
    assert.equal((await labels())[2], "0.001");
    await page.getByRole("tab", { name: "Distances" }).click();
    await changed(page, "field");
    assert.ok(Number((await labels())[2]) > 1);
    assert.equal(await page.getByLabel("Colours end at").inputValue(), "");
  });

  await test("files are written beside the page, however large they are", async () => {
    const threads = [];
    page.on("worker", (worker) => threads.push(worker.url()));
    await page.getByRole("tab", { name: "Modes" }).click();
    await changed(page, "mode");
    const vertices = await page.evaluate(() => window.chladni.app.mesh.vertices);
    for (const name of ["OBJ", "GLB", "CSV", "NPY (NumPy)"]) {
      const before = threads.length;
      assert.ok((await saved(page, name)).length > vertices);
      assert.ok(threads.length === before + 1 && threads[before].includes("fileworker"), `${threads}`);
    }
  });

  await test("shapes have pictures", async () => {
    for (const shape of ["sphere", "disk"]) await opened(page, shape, shape, 900, 30);
    // Fields have another spectrum: shapes are not compared by it, however long it is.
    await page.evaluate(() => window.chladni.app.submit("eigenbasis", { count: 50, method: "hsim", operator: "hodge", tolerance: 1e-2 }));
    await page.waitForFunction(() => window.chladni.app.bases.some(({ count }) => count === 50), null, { timeout: 60_000 });
    const asked = page.waitForRequest((request) => request.url().includes("/v1/shape-comparisons"));
    await page.getByRole("tab", { name: "Shapes" }).click();
    await page.waitForFunction(() => document.querySelectorAll("canvas.portrait[data-drawn]").length >= 3);
    const hodge = await page.evaluate(() => window.chladni.app.bases.find(({ count }) => count === 50).id);
    assert.ok(!(await asked).postDataJSON().bases.includes(hodge));
    const filled = await page.evaluate(() => [...document.querySelectorAll("canvas.portrait[data-drawn]")].map((canvas) => {
      const { data } = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height);
      let count = 0;
      for (let i = 3; i < data.length; i += 4) count += data[i] > 0 ? 1 : 0;
      return count / (canvas.width * canvas.height);
    }));
    assert.ok(filled.every((part) => part > 0.1 && part < 0.9), `${filled}`);
    await keep(page, "collection");
  });

  await test("whoever wants little motion gets none by itself", async () => {
    const calm = await site.open("/", { reducedMotion: "reduce" });
    await calm.locator("details.examples summary").click();
    await calm.locator("details.examples").getByRole("button", { name: "bell" }).click();
    await calm.waitForFunction(() => document.body.dataset.mode === "12");
    assert.equal(await calm.evaluate(() => window.chladni.viewer.moving), false);
    await calm.getByRole("button", { name: "Animate" }).click();
    assert.equal(await calm.evaluate(() => window.chladni.viewer.moving), true);
    await calm.evaluate(() => window.chladni.app.toast("note", "A note", "that does not rise"));
    assert.equal(await calm.locator(".toast").first().evaluate((toast) => getComputedStyle(toast).animationName), "none");
    await calm.context().close();
  });
  await page.context().close();
}
