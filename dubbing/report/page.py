"""The page of the report; data from ``report.collect``, no scripts, nothing from the network."""

TEMPLATE = """<!doctype html>
<html lang="en"><head><meta charset="utf-8"><title>Dubs of {{ manifest }}</title>
<style>
body { font: 15px/1.45 system-ui, sans-serif; margin: 2em auto; max-width: 70em; padding: 0 1em;
  color: #222; background: #fafafa }
section { background: #fff; border: 1px solid #ddd; border-radius: 8px; padding: 1em 1.2em;
  margin: 1em 0; overflow: hidden }
h3 { margin: 0 0 .5em } .side { float: right; margin-left: 1.5em }
video { max-height: 26em; max-width: 34em } img { max-width: 100%; border-radius: 4px }
.tag { border-radius: 1em; padding: .1em .7em; font-size: .8em; color: #fff; background: #888 }
.made, .kept, .pass { background: #2a7d46 } .warn { background: #b07a10 }
.failed, .skipped, .stopped, .fail { background: #b3282d }
.failure { border-left: 4px solid #b3282d; padding-left: 1em } td { padding-right: 1.2em }
svg { background: #f4f4f4; overflow: visible; margin-right: 1em }
polyline { fill: none; stroke: #2b5fa8; stroke-width: 1.5 } .note { color: #666 }
pre { overflow-x: auto; font-size: 12px }
</style></head><body>
<h1>Dubs</h1>
<p class="note">{{ manifest }} &middot; {{ seconds }} s &middot; at most {{ peak_memory_mb }} MB
&middot; {{ machine.cores }} cores &middot; exit code {{ code }}.
The pictures are AI-generated; every file says so in its metadata.</p>
{% for warning in warnings %}<p class="note">{{ warning }}</p>{% endfor %}

{% macro failed(job) %}{% if job.failure %}<div class="failure">
<p><b>{{ job.failure.stage }}</b>: {{ job.failure.what }}
{% if job.failure.where %}<span class="note">({{ job.failure.where }})</span>{% endif %}</p>
{% if job.failure.remedy %}<p><b>What to do:</b> {{ job.failure.remedy }}</p>{% endif %}
{% if job.failure.trace %}<details><summary>Trace</summary><pre>{{ job.failure.trace }}</pre>
</details>{% endif %}</div>{% endif %}{% endmacro %}

{% macro times(job) %}<table>{% for name, stage in job.stages.items() %}<tr><td>{{ name }}</td>
<td>{% if stage.seconds is not none %}{{ stage.seconds }} s{% elif stage.recorded_seconds %}
<span class="note">kept ({{ stage.recorded_seconds }} s when made)</span>{% else %}
<span class="note">&ndash;</span>{% endif %}</td>
<td class="note">{{ stage.reasons | join(", ") }}</td></tr>{% endfor %}</table>{% endmacro %}

{% macro sync_line(sync) %}{% if sync %}<p><span class="tag {{ sync.verdict }}">
{{ sync.verdict }}</span> {{ sync.words or "" }}, {{ sync.reason }}
{% if sync.confidence is not none %}<span class="note">confidence
{{ "%.3f" | format(sync.confidence) }}{% if sync.source_confidence is not none %}, the source's
{{ "%.3f" | format(sync.source_confidence) }}{% endif %}</span>{% endif %}</p>
{% if sync.curve %}<svg width="320" height="80"><polyline points="{{ sync.curve | curve }}"/></svg>
<span class="note">distance over offsets of -15 to 15 frames</span>
{% endif %}{% endif %}{% endmacro %}

<h2>Results</h2>
{% for name, job in dubs.items() %}<section id="dub-{{ name }}">
{% if job.video %}<video class="side" controls preload="metadata" src="{{ job.video | urlencode }}">
</video>{% endif %}
<h3>{{ name }} <span class="tag {{ job.state }}">{{ job.state }}</span></h3>
<p>with the face of <a href="#identity-{{ job.identity }}">{{ job.identity }}</a>
{% if job.video %}&middot; <a href="{{ job.video | urlencode }}">{{ job.video }}</a>{% endif %}</p>
{{ failed(job) }}{{ sync_line(job.sync) }}{{ times(job) }}
</section>{% else %}<p>The manifest has no dubs.</p>{% endfor %}

<h2>People</h2>
{% for name, job in identities.items() %}<section id="identity-{{ name }}">
<h3>{{ name }} <span class="tag {{ job.state }}">{{ job.state }}</span></h3>
<p>{{ job.clip }}<br>Consent: {{ job.consent.by }}, {{ job.consent.reference }}
{% if job.consent.date %}({{ job.consent.date }}){% endif %}</p>
{{ failed(job) }}
{% for warning in job.warnings %}<p class="note">{{ warning }}</p>{% endfor %}
{{ sync_line(job.sync) }}
{% if job.loss %}<p><svg width="320" height="80"><polyline points="{{ job.loss | curve }}"/></svg>
<span class="note">loss, last {{ "%.3g" | format(job.loss[-1]) }}</span></p>{% endif %}
{% if job.psnr %}<p><svg width="320" height="80"><polyline points="{{ job.psnr | curve }}"/></svg>
<span class="note">PSNR of training rays, last {{ "%.1f" | format(job.psnr[-1]) }} dB</span></p>
{% endif %}
{{ times(job) }}
{% if job.contact_sheet %}<p><img src="{{ job.contact_sheet | urlencode }}" alt="contact sheet">
</p>{% endif %}
</section>{% endfor %}
</body></html>
"""
