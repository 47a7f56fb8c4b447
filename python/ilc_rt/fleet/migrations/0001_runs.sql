-- Runs of many cells. A run is known by its cell, campaign, number and digest; its arrays are a table of their own,
-- so that lists stay small.

-- Program and parameters of a law are long, and the same for all runs of a campaign.
CREATE TABLE provenance (
    digest          text PRIMARY KEY,
    program         text NOT NULL,
    law_parameters  text NOT NULL
);

CREATE TABLE run (
    id              bigint GENERATED ALWAYS AS IDENTITY PRIMARY KEY,
    cell            text NOT NULL,
    campaign        text NOT NULL,
    iteration       integer NOT NULL CHECK (iteration >= 0),
    digest          text NOT NULL,
    created_utc     text NOT NULL,
    law             text NOT NULL,
    measure         text NOT NULL,
    cycle_s         double precision NOT NULL,
    n_axes          integer NOT NULL,
    axis_names      json NOT NULL,
    input_units     json NOT NULL,
    n_samples       integer NOT NULL,
    disturbance     json,
    -- The type json keeps the text, and so every bit of a number.
    figures         json NOT NULL,
    -- Both are missing while a run is known from its event alone; sync adds them, and the arrays.
    fingerprint     text,
    provenance      text REFERENCES provenance,
    stored_at       timestamptz NOT NULL DEFAULT now(),
    UNIQUE (cell, campaign, iteration, digest)
);
CREATE INDEX run_by_campaign ON run (campaign, iteration);
CREATE INDEX run_by_law ON run (law, n_samples);

-- Little-endian float64, time first, as in the library file.
CREATE TABLE signals (
    run             bigint PRIMARY KEY REFERENCES run ON DELETE CASCADE,
    reference_m     bytea NOT NULL,
    input           bytea NOT NULL,
    encoder_m       bytea NOT NULL,
    tool_m          bytea,
    error_m         bytea NOT NULL,
    contour_m       bytea NOT NULL
);

-- For dashboards that speak SQL: the main figures as numbers.
CREATE VIEW run_summary AS
SELECT run.id, cell, campaign, iteration, created_utc::timestamptz AS created_at, law, measure, n_samples, cycle_s,
    (figures ->> 'tracking_rms_m')::double precision AS tracking_rms_m,
    (figures ->> 'tracking_inf_m')::double precision AS tracking_inf_m,
    (figures ->> 'contour_rms_m')::double precision AS contour_rms_m,
    (figures ->> 'contour_inf_m')::double precision AS contour_inf_m,
    (figures ->> 'overruns')::bigint AS overruns,
    (figures ->> 'rolled_back')::boolean AS rolled_back,
    figures ->> 'remark' AS remark,
    fingerprint IS NOT NULL AS has_signals
FROM run;
